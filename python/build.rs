//! Links the names of `mathematics.rs` into the module itself.

fn main() {
    println!("cargo:rerun-if-changed=build.rs");
    if std::env::var("CARGO_CFG_TARGET_OS").as_deref() == Ok("linux") {
        // A shared object's own functions may be replaced by those of the program that loads it,
        // and Python loads the platform's mathematics. Here they are bound when this is linked
        // (tests/it/binary.rs).
        println!("cargo:rustc-cdylib-link-arg=-Wl,-Bsymbolic-functions");
    }
}
