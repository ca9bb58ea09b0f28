//! Keys and signed firmware images.
#![allow(
    clippy::expect_used,
    clippy::panic,
    clippy::print_stdout,
    reason = "a test fails loudly and shows its figures"
)]

mod common;

use std::os::unix::fs::PermissionsExt;
use std::path::Path;

use common::images::{ARM, START, Workshop, application, elf};
use common::{fails_with, run, run_json, text};

#[test]
fn a_key_is_secret_and_never_written_over() {
    let workshop = Workshop::new();
    let [key, _] = workshop.key("rig.key");
    let read = |key: &str| std::fs::read(key).expect("a key");
    assert_eq!(std::fs::metadata(&key).expect("written").permissions().mode() & 0o777, 0o600);
    let before = read(&key);
    fails_with(&["image", "keygen", "--out", &key], 2, &["rig.key", "exists"]);
    assert_eq!(read(&key), before);
    assert_ne!(read(&workshop.key("other.key")[0]), before);
}

#[test]
fn an_image_tells_what_it_is_and_whose() {
    let workshop = Workshop::new();
    let ([key, public], [_, other]) = (workshop.key("a.key"), workshop.key("b.key"));
    let (image, made) = workshop.sign(&application(), &key, "nucleo-g474", "1.2.3", "app.vimg");
    assert_eq!((&made["hardware"], &made["version"]), (&"nucleo-g474".into(), &"1.2.3".into()));
    assert_eq!(made["length"], application().len());
    assert_eq!(made["build"], "0123456789abcdef", "as the application reads it");

    let info = run_json(&["image", "info", &image, "--key", &public, "--json"]);
    assert_eq!(info["signature_valid"], true);
    assert_eq!((&info["sha256"], &info["build"]), (&made["sha256"], &made["build"]));
    fails_with(&["image", "info", &image, "--key", &other], 1, &["not signed by"]);
    fails_with(&["image", "info", &image], 1, &["not signed by the key development"]);

    let (image, _) = workshop.sign(&application(), "development", "nucleo-g474", "1.2.3", "dev.vimg");
    let info = run(&["image", "info", &image]);
    assert!(info.status.success() && text(&info.stdout).contains("anybody can sign so"));

    // One bit of the image, of the header, of the signature; and the end missing.
    let whole = std::fs::read(&image).expect("an image");
    for (at, word) in [(140, "SHA-256"), (8, "no signed image"), (60, "no signed image")] {
        let mut damaged = whole.clone();
        damaged[at] ^= 1;
        fails_with(&["image", "info", &workshop.file("bad.vimg", &damaged)], 2, &["bad.vimg", word]);
    }
    let cut = workshop.file("cut.vimg", &whole[..whole.len() - 1]);
    fails_with(&["image", "info", &cut], 2, &["not as long"]);
}

#[test]
fn an_elf_file_becomes_the_bytes_of_flash() {
    let workshop = Workshop::new();
    let app = application();
    let (code, data) = app.split_at(64);
    let with_gap = [code, &[0xFF; 16], data].concat();
    let linked = elf(ARM, &[(START + 80, data), (START, code)]);
    let [(flat, expected), (linked, got)] = [(&with_gap, "flat.vimg"), (&linked, "linked.vimg")]
        .map(|(content, name)| workshop.sign(content, "development", "nucleo-g474", "1.2.3", name));
    assert_eq!(got, expected);
    assert_eq!(std::fs::read(flat).expect("an image"), std::fs::read(linked).expect("an image"));
}

#[test]
fn the_version_is_the_applications_own() {
    let workshop = Workshop::new();
    let (mut without, out) = (application(), workshop.path("out.vimg"));
    without.resize(without.len().next_multiple_of(4), 0);
    // An ELF note: sizes of name and content, type, name, content.
    let note = [&[4, 0, 0, 0, 4, 0, 0, 0, 1, 0, 0, 0][..], b"VGC\0", &[2, 5, 1, 0]].concat();
    let with = [&without[..], &note].concat();
    let [without, with, linked] =
        [("without.bin", &without), ("with.bin", &with), ("with.elf", &elf(ARM, &[(START, &with)]))]
            .map(|(name, content)| workshop.file(name, content));
    let sign = |file: &str, more: &[&str]| {
        let options =
            ["image", "sign", file, "--key", "development", "--hardware", "nucleo-g474", "--out", &out, "--json"];
        [&options[..], more].concat().into_iter().map(str::to_owned).collect::<Vec<_>>()
    };
    let made = |arguments: Vec<String>| run_json(&arguments.iter().map(String::as_str).collect::<Vec<_>>());
    let refused = |arguments: Vec<String>, words: &[&str]| {
        fails_with(&arguments.iter().map(String::as_str).collect::<Vec<_>>(), 2, words);
    };
    for file in [&with, &linked] {
        assert_eq!(made(sign(file, &[]))["version"], "2.5.1");
        assert_eq!(made(sign(file, &["--version", "2.5.1"]))["version"], "2.5.1");
        refused(sign(file, &["--version", "2.6.0"]), &["it is version 2.5.1, not 2.6.0"]);
    }
    assert_eq!(made(sign(&without, &["--version", "1.0.0"]))["version"], "1.0.0");
    refused(sign(&without, &[]), &["without.bin", "--version"]);
}

#[test]
fn what_cannot_be_signed_is_told() {
    let workshop = Workshop::new();
    let (app, out) = (application(), workshop.path("out.vimg"));
    let refused = |name: &str, content: &[u8], words: &[&str]| {
        let input = workshop.file(name, content);
        let options = ["--key", "development", "--version", "1.0.0", "--hardware", "nucleo-g474", "--out", &out];
        fails_with(&[&["image", "sign", &input], &options[..]].concat(), 2, words);
        assert!(!Path::new(&out).exists());
    };
    refused("empty.bin", &[], &["empty.bin", "1 to 188416 bytes"]);
    refused("long.bin", &vec![0; 188_417], &["188417"]);
    refused("noise.bin", &[7; 100], &["vector table"]);
    refused("x86.elf", &elf(3, &[(START, &app)]), &["not for an Arm processor"]);
    refused("elsewhere.elf", &elf(ARM, &[(0x0800_0000, &app)]), &["0x08000000", "outside"]);
    refused("far.elf", &elf(ARM, &[(START, &app), (0xFFFF_FFF0, &app)]), &["0xfffffff0", "outside"]);
    refused("cut.elf", &elf(ARM, &[(START, &app)])[..100], &["cut.elf", "cut off"]);
    refused("head.elf", b"\x7fELF\x01\x01", &["head.elf", "cannot be read"]);

    let bin = workshop.file("app.bin", &app);
    let refused = |key: &str, version: &str, hardware: &str, words: &[&str]| {
        let options = ["--key", key, "--version", version, "--hardware", hardware, "--out", &out];
        fails_with(&[&["image", "sign", &bin], &options[..]].concat(), 2, words);
    };
    refused("development", "1.2", "nucleo-g474", &["1.2.3"]);
    refused("development", "1.2.256", "nucleo-g474", &["255"]);
    refused("development", "1.2.3", "toaster", &["native-sim"]);
    refused(&bin, "1.2.3", "nucleo-g474", &["app.bin"]);
    refused("/nowhere/key", "1.2.3", "nucleo-g474", &["/nowhere/key"]);
    refused(&workshop.key("a.key")[1], "1.2.3", "nucleo-g474", &["not a secret key"]);
}
