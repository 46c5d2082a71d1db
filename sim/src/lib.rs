//! Interactive, physically based virtual environments: objects, their interactions and their
//! behaviour, and the executors that advance them frame by frame.
//!
//! An environment is a list of [`object::Object`]s and a table of [`interaction::Rules`]. Its frames
//! have four stages: broad phase, interaction, update and render. The stages themselves are
//! [`stages::Stages`], work on [`block::Block`]s of objects, and are the same for every executor; so
//! are the results, bit for bit, whatever the executor, the number of threads and the blocking.
//!
//! ```
//! use dualframe_sim::manager::{Settings, VeManager};
//! use dualframe_sim::render::NullRenderer;
//! use dualframe_sim::scene::ParticleScene;
//!
//! // Ten deformable particles in a room; the pipeline, two threads.
//! let scene = ParticleScene::new(10).build()?;
//! let mut manager = VeManager::new(scene, Settings { threads: 2, ..Settings::default() })?;
//! let mut renderer = NullRenderer::new();
//! let mut collisions = 0;
//! manager.run(60, &mut renderer, &mut |record| collisions += record.pairs.collisions)?;
//! assert_eq!((manager.frame(), renderer.swaps()), (60, 60));
//! println!("{collisions} collisions, state {:016x}", manager.state_hash());
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
//!
//! `examples/own_object.rs` has an object with a behaviour, an interaction and a renderer of one's own.
//!
//! | paper | module |
//! |---|---|
//! | §4.1, Fig. 2: 3D Object (visual properties, geometry, behaviour, renderer) | [`object`], [`geometry`], [`behavior`], [`render`] |
//! | §4.1, Fig. 3: interaction pair (detection, response, results) | [`interaction`] |
//! | §5.2, Fig. 7: callbacks | [`stages`] |
//! | §6.1, Fig. 9: VE Manager | [`manager`] |
//! | Object Manager: maintains the objects and where they go | [`blocking`], [`block`] |
//! | Object Interaction Manager: the complete set of interaction pairs | [`interaction::Rules`]; the queues are the core's |
//! | thread pool | [`pool`] |
//! | §6.2: messages | [`message`]; from outside: [`mailbox`] |
//! | §6.3: haptic devices | [`device`] |
//! | §7.1.1: particles | [`scene`] |
//! | §7.2: the pipeline and what it is compared with | [`executor`] |
//! | §7–§8: Eqs. 2–4, Figs. 11–18, Table 1 | `experiment`, with the feature of that name |
//! | (not in the paper) computed tomography in, volumes out | `image`, with the feature of that name |
//! | (not in the paper) what each worker did when | [`timeline`] |
//! | (not in the paper) sessions recorded and replayed, bit for bit | [`record`] |
//! | (not in the paper) kernels in vector instructions | [`simd`] |

#![deny(unsafe_code)]

pub mod behavior;
pub mod block;
pub mod blocking;
mod cost;
pub mod device;
pub mod executor;
#[cfg(feature = "experiment")]
pub mod experiment;
mod fill;
pub mod geometry;
#[cfg(feature = "image")]
pub mod image;
pub mod interaction;
pub mod mailbox;
pub mod manager;
pub mod message;
mod mix;
pub mod object;
mod parallel;
pub mod pool;
pub mod record;
pub mod render;
pub mod scene;
#[allow(unsafe_code)]
pub mod simd;
pub mod stages;
pub mod state;
pub mod timeline;
