//! What loom explores: every model as it is, with each order weakened, and with bugs seeded. In one program,
//! since the models take longest to compile.

mod explore;
#[path = "../models/mod.rs"]
mod models;
mod mutants;
mod protocol_mutants;
mod seeded;
