//! What a person can change of the particles.

use egui::{DragValue, Grid, Slider, Ui};

use crate::app::args::Particles;
use crate::app::window::controls::Controls;

/// What a person can change of the particles.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Physics {
    /// Downwards, in metres per second squared.
    pub(super) gravity: f32,
    /// Of the springs between nodes, in newtons per metre.
    pub(super) stiffness: f32,
    /// Of springs, in newton seconds per metre.
    pub(super) damping: f32,
    /// Particles at the next start.
    pub(super) objects: usize,
    /// How many they may be.
    pub(super) most_objects: usize,
}

impl Physics {
    /// What a particle environment starts with; see [`dualframe_sim::scene::ParticleScene`].
    pub(super) fn new(args: &Particles) -> Self {
        let gravity = if args.gravity { 9.81 } else { 0.0 };
        let (objects, most_objects) = (args.objects, args.most_objects());
        Self { gravity, stiffness: 60.0, damping: 0.02, objects, most_objects }
    }

    pub(super) fn show(&mut self, ui: &mut Ui, controls: &mut Controls) {
        Grid::new("physics").num_columns(2).show(ui, |ui| {
            ui.label("gravity");
            ui.add(Slider::new(&mut self.gravity, 0.0..=20.0).suffix(" m/s²"));
            ui.end_row();
            ui.label("stiffness");
            ui.add(Slider::new(&mut self.stiffness, 5.0..=120.0).suffix(" N/m"));
            ui.end_row();
            ui.label("damping");
            ui.add(Slider::new(&mut self.damping, 0.0..=0.1).suffix(" N·s/m"));
            ui.end_row();
            ui.label("particles");
            ui.horizontal(|ui| {
                let objects = DragValue::new(&mut self.objects);
                ui.add(objects.range(1..=self.most_objects).speed(10.0));
                if ui.button("Restart").clicked() {
                    controls.restarts += 1;
                }
            });
            ui.end_row();
        });
    }
}

#[cfg(test)]
mod tests {
    use clap::{Args, Command, FromArgMatches};
    use dualframe_sim::scene::ParticleScene;
    use egui::{Context, RawInput};

    use super::*;

    #[test]
    fn no_more_particles_than_the_broad_phase_allows() {
        for (kind, most) in [("spatial", ParticleScene::MAX_OBJECTS), ("pairwise", 4_090)] {
            let command = Particles::augment_args(Command::new("dualframe"));
            let matches = command.get_matches_from(["dualframe", "--broad-phase", kind]);
            let args = Particles::from_arg_matches(&matches).expect("sound arguments");
            let (mut physics, mut controls) = (Physics::new(&args), Controls::new(&args.way));
            physics.objects = usize::MAX;
            let show = |ui: &mut Ui| physics.show(ui, &mut controls);
            let mut drawn = Context::default().run_ui(RawInput::default(), show);
            // What is left of it would be reported as forgotten.
            drawn.textures_delta.clear();
            assert_eq!(physics.objects, most, "{kind}");
        }
    }
}
