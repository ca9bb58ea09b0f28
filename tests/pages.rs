//! The pages for people: every link resolves, every file named exists, and the book names every page.
#![allow(clippy::expect_used, clippy::panic, reason = "a test fails loudly")]

use std::collections::BTreeSet;
use std::fmt::{Debug, Display};
use std::path::{Path, PathBuf};

use serde::de::DeserializeOwned;
use vergence_protocol::management::Outcome;
use vergence_protocol::{FaultCode, Refusal};

/// The folders a path in the repository can begin with.
const TOP: &[&str] = &["protocol/", "firmware/", "host/", "hil-sim/", "tests/", "docs/", ".ci/"];

fn root() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../..").canonicalize().expect("the repository")
}

fn read(path: &Path) -> String {
    std::fs::read_to_string(path).unwrap_or_else(|error| panic!("{}: {error}", path.display()))
}

/// Every Markdown file below `folder`, in order.
fn pages_below(folder: &Path) -> BTreeSet<PathBuf> {
    let entries = std::fs::read_dir(folder).expect("a folder");
    let (folders, files): (Vec<_>, Vec<_>) =
        entries.map(|entry| entry.expect("an entry").path()).partition(|path| path.is_dir());
    let pages = files.into_iter().filter(|path| path.extension().is_some_and(|ending| ending == "md"));
    pages.chain(folders.iter().flat_map(|folder| pages_below(folder))).collect()
}

/// The pages at the top of the repository, those of the book, and those beside the code.
fn pages() -> Vec<PathBuf> {
    let top = ["README.md", "CONTRIBUTING.md", "CHANGELOG.md", "hil-sim/FIDELITY.md"].map(|page| root().join(page));
    top.into_iter().chain(pages_below(&root().join("docs"))).collect()
}

/// The lines of a page outside its code blocks.
fn prose(page: &str) -> impl Iterator<Item = &str> {
    page.lines().scan(false, |in_code, line| {
        let fence = line.trim_start().starts_with("```");
        *in_code ^= fence;
        Some(if *in_code || fence { "" } else { line })
    })
}

/// The targets of the links and pictures of a page.
fn links(page: &str) -> impl Iterator<Item = &str> {
    prose(page).flat_map(|line| line.split("](").skip(1).filter_map(|rest| rest.split(')').next()))
}

/// The name under which GitHub and mdBook link to a heading.
fn anchor(heading: &str) -> String {
    let kept = heading.trim_start_matches('#').trim().chars().filter(|c| c.is_alphanumeric() || " -_".contains(*c));
    kept.map(|c| if c == ' ' { '-' } else { c }).collect::<String>().to_lowercase()
}

fn anchors(page: &str) -> BTreeSet<String> {
    prose(page).filter(|line| line.starts_with('#')).map(anchor).collect()
}

/// What stands between backticks.
fn code_spans(page: &str) -> impl Iterator<Item = &str> {
    prose(page).flat_map(|line| line.split('`').skip(1).step_by(2))
}

#[test]
fn every_link_resolves() {
    let mut broken = Vec::new();
    let mut followed = 0;
    for page in pages() {
        let text = read(&page);
        for link in links(&text).filter(|link| !link.contains("://") && !link.starts_with("mailto:")) {
            followed += 1;
            let (file, heading) = link.split_once('#').map_or((link, None), |(file, heading)| (file, Some(heading)));
            let target = if file.is_empty() { page.clone() } else { page.with_file_name("").join(file) };
            let found = target.exists() && heading.is_none_or(|heading| anchors(&read(&target)).contains(heading));
            if !found {
                broken.push(format!("{}: {link}", page.display()));
            }
        }
    }
    assert!(broken.is_empty(), "links that lead nowhere:\n{}", broken.join("\n"));
    assert!(followed > 50, "only {followed} links were found");
}

#[test]
fn every_file_named_exists() {
    let mut missing = Vec::new();
    let mut named = 0;
    for page in pages().into_iter().filter(|page| !page.ends_with("CHANGELOG.md")) {
        let text = read(&page);
        let paths = code_spans(&text).filter(|span| TOP.iter().any(|top| span.starts_with(top)));
        for path in paths.filter(|path| !path.contains([' ', '*', '<', '{'])) {
            named += 1;
            if !root().join(path).exists() {
                missing.push(format!("{}: {path}", page.display()));
            }
        }
    }
    assert!(missing.is_empty(), "files that do not exist:\n{}", missing.join("\n"));
    assert!(named > 50, "only {named} files are named");
}

/// The rows of the walks name a step, a file, and a function or type of it.
#[test]
fn the_walks_name_what_is_in_the_files() {
    let page = read(&root().join("docs/architecture.md"));
    let rows = page.lines().filter_map(|line| {
        let cells: Vec<_> = line.split(" | ").map(|cell| cell.trim_matches(['|', ' ', '`'])).collect();
        let [_, file, name] = cells[..] else { return None };
        file.ends_with(".rs").then_some((file, name))
    });
    let mut walked = 0;
    for (file, name) in rows {
        let source = read(&root().join(file));
        let defined = ["fn ", "struct ", "enum "].iter().any(|kind| source.contains(&format!("{kind}{name}")));
        assert!(defined, "{file} defines no {name}");
        walked += 1;
    }
    assert!(walked > 25, "only {walked} steps were found");
}

#[test]
fn contributing_begins_with_a_map_of_twenty_questions() {
    let page = read(&root().join("CONTRIBUTING.md"));
    let map = page.split("\n## ").nth(1).expect("a first section");
    assert!(map.starts_with("Where is ...?"));
    assert_eq!(map.lines().filter(|line| line.starts_with("| Where ")).count(), 20);
}

#[test]
fn the_book_names_every_page() {
    let docs = root().join("docs");
    let summary = read(&docs.join("SUMMARY.md"));
    let named: BTreeSet<PathBuf> = links(&summary).map(|link| docs.join(link)).collect();
    let mut there = pages_below(&docs);
    assert!(there.remove(&docs.join("SUMMARY.md")));
    assert_eq!(named, there);
    assert!(read(&root().join("book.toml")).contains("src = \"docs\""));
}

/// Every value of an enum of the wire: the wire's numbers are tried one after the other until there is none with the next.
fn codes<T: DeserializeOwned>() -> Vec<T> {
    (0..u8::MAX).map_while(|code| postcard::take_from_bytes(&[code, 0]).ok().map(|(value, _)| value)).collect()
}

/// Checks that the section has a row for each of `codes`, with its name and its message. Returns how many there are.
fn explained<T: Debug + Display>(section: &str, codes: &[T]) -> usize {
    for code in codes {
        let name = format!("{code:?}").split(' ').next().expect("a name").to_owned();
        let message = code.to_string().replace("axis 0", "axis N");
        let row = format!("| `{name}` | {message} |");
        assert!(section.contains(&row), "docs/troubleshooting.md lacks a row that begins with\n{row}");
    }
    codes.len()
}

#[test]
fn every_fault_and_refusal_is_explained() {
    let page = read(&root().join("docs/troubleshooting.md"));
    let section = |heading: &str| {
        let from = page.split_once(&format!("\n## {heading}\n")).unwrap_or_else(|| panic!("no section '{heading}'")).1;
        from.split("\n## ").next().unwrap_or_default().to_owned()
    };
    assert!(explained(&section("Faults of the board"), &codes::<FaultCode>()) >= 15);
    assert!(explained(&section("Requests that the board refuses"), &codes::<Refusal>()) >= 17);
    let outcomes: Vec<Outcome> = codes().into_iter().filter(|outcome| *outcome != Outcome::Done).collect();
    assert!(explained(&section("Updates that the board refuses"), &outcomes) >= 10);
}
