//! Tells the linker where `memory.x` and `build-id.x` are, and to use them.

fn main() {
    println!("cargo::rustc-link-search={}", env!("CARGO_MANIFEST_DIR"));
    println!("cargo::rerun-if-changed=memory.x");
    println!("cargo::rerun-if-changed=build-id.x");
    // The build id is a hash of the contents: same source, same id.
    for argument in ["--nmagic", "-Tlink.x", "-Tdefmt.x", "-Tbuild-id.x", "--build-id=sha1"] {
        println!("cargo::rustc-link-arg-bins={argument}");
    }
}
