//! One small VE ([`ve`]) on three machines, to the same bits: four bare RISC-V cores that wake each
//! other by interrupts, one bare Cortex-M4F, and a host's threads. On the bare ones timer interrupts
//! post letters into the running pipeline. All memory is static; `README.md` says how to run it.
#![cfg_attr(target_os = "none", no_std, no_main)]

mod mail;
mod run;
mod ve;

#[cfg(target_os = "none")]
mod bare;
#[cfg(all(target_arch = "arm", target_os = "none"))]
mod cortex_m4f;
#[cfg(all(target_arch = "riscv64", target_os = "none"))]
mod four_cores;
#[cfg(not(target_os = "none"))]
mod host;

/// Runs the VE on the host.
#[cfg(not(target_os = "none"))]
fn main() -> std::process::ExitCode {
    host::main()
}
