//! Tells the linker where the machines' memory lies.

use std::env;

fn main() {
    let here = env::var("CARGO_MANIFEST_DIR").unwrap_or_default();
    match env::var("TARGET").unwrap_or_default().as_str() {
        "riscv64gc-unknown-none-elf" => {
            println!("cargo:rustc-link-arg-bins=-T{here}/riscv64.ld");
        }
        "thumbv7em-none-eabihf" => {
            // cortex-m-rt's script, which includes `memory.x`.
            println!("cargo:rustc-link-search={here}");
            println!("cargo:rustc-link-arg-bins=-Tlink.x");
        }
        _ => {}
    }
    for file in ["build.rs", "riscv64.ld", "memory.x"] {
        println!("cargo:rerun-if-changed={file}");
    }
}
