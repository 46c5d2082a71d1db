//! Compiles the native peers' C++, if the feature asks for them.

fn main() {
    #[cfg(feature = "native-peers")]
    native_peers();
}

/// OpenMP is GCC's, oneTBB the system's.
#[cfg(feature = "native-peers")]
fn native_peers() {
    const SHIM: &str = "src/executor/native/shim.cpp";
    println!("cargo::rerun-if-changed={SHIM}");
    cc::Build::new().cpp(true).std("c++17").flag("-fopenmp").file(SHIM).compile("dualframe_shim");
    println!("cargo::rustc-link-lib=gomp");
    println!("cargo::rustc-link-lib=tbb");
}
