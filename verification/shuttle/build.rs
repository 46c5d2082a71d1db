//! Sets `cfg(shuttle)` for this package, its library and its tests, and for no other.

fn main() {
    println!("cargo:rustc-cfg=shuttle");
    println!("cargo:rustc-check-cfg=cfg(shuttle)");
    // A feature of the package that the source belongs to, and none of this one.
    println!("cargo:rustc-check-cfg=cfg(feature, values(\"portable-atomic\"))");
    println!("cargo:rerun-if-changed=build.rs");
}
