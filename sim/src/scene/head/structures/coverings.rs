//! What covers skull and brain: scalp, muscle, periosteum, dura and its folds.

use glam::Vec3;

use super::make::{DURA, MUSCLE, PERIOSTEUM, SCALP, Tissue};
use super::{Hold, Structure};
use crate::geometry::Bounds;
use crate::scene::head::anatomy::{Scale, scalp_at, site, temple, tentorium};
use crate::scene::head::frame::{RIGHT, UP, parts};
use crate::scene::head::layers::Layers;
use crate::scene::head::radial::cube;
use crate::scene::head::surface::{Surface, extract};

/// How sheets are relaxed: 6 times there and back, which evens nodes and keeps the border's corners.
const RELAX: (usize, [f32; 2]) = (6, [0.5, -0.5]);
/// How far down sheets on the vault go, in metres from the head's middle; usually 50 mm.
const FLOOR: f32 = -0.05;

/// The patches of the scalp, with the distances of their grids in metres.
const SCALP_PATCHES: [(&str, f32); 5] = [
    ("right frontotemporoparietal scalp", 0.006),
    ("frontal scalp", 0.009),
    ("left scalp", 0.010),
    ("occipital scalp", 0.010),
    ("right mastoid scalp", 0.009),
];

/// The patches of the dura.
const DURA_PATCHES: [(&str, f32); 3] =
    [("right convexity dura", 0.006), ("left convexity dura", 0.009), ("posterior dura", 0.009)];

pub(super) fn make(layers: &Layers) -> impl Iterator<Item = Structure> {
    let scalp = SCALP_PATCHES.into_iter().enumerate().map(|(number, (name, spacing))| {
        patch(&SCALP, name, spacing, &|d| layers.skin.at(d), number, scalp_at)
    });
    let dura = DURA_PATCHES.into_iter().enumerate().map(|(number, (name, spacing))| {
        let depth = 0.5 * DURA.thickness;
        patch(&DURA, name, spacing, &|d| layers.inner.at(d) - depth, number, dura_at)
    });
    let muscles = [
        muscle(layers, "right temporalis", 1.0),
        muscle(layers, "left temporalis", -1.0),
        periosteum(layers),
    ];
    let folds = [falx(layers), tentorium_sheet(layers)];
    scalp.chain(muscles).chain(dura).chain(folds)
}

/// The patch of the dura that a direction is in.
fn dura_at(direction: Vec3) -> Option<usize> {
    let [right, front, up] = parts(direction);
    if up < -0.35 + 0.35 * front.max(0.0) {
        None
    } else if direction.dot(site()) > 0.656 {
        Some(0)
    } else {
        Some(if right < 0.0 && front > -0.6 { 1 } else { 2 })
    }
}

/// The sheet of a surface, star-shaped around the head's middle, where `keep` says so of a direction.
fn sheet(radius: &dyn Fn(Vec3) -> f32, spacing: f32, keep: impl Fn(Vec3) -> bool) -> Surface {
    let field = |point: Vec3| point.length() - radius(point);
    let mut bounds = Bounds::EMPTY;
    for direction in cube(14) {
        let point = direction.normalize() * radius(direction);
        if parts(point)[2] >= FLOOR {
            bounds = bounds.union(&Bounds { min: point, max: point });
        }
    }
    let (rounds, shares) = RELAX;
    extract(&bounds.inflated(spacing), spacing, field)
        .sheet(|point| parts(point)[2] > FLOOR && keep(point.normalize()))
        .relaxed(rounds, &shares, |point| point.normalize() * radius(point))
        .upright(|point| point)
}

/// A patch of scalp or dura: loose on the bone, and grown on where it ends and no other patch begins.
fn patch(
    tissue: &Tissue,
    name: &'static str,
    spacing: f32,
    radius: &dyn Fn(Vec3) -> f32,
    number: usize,
    patch_at: impl Fn(Vec3) -> Option<usize>,
) -> Structure {
    let surface = sheet(radius, spacing, |direction| patch_at(direction) == Some(number));
    let count = surface.positions.len().max(1) as f32;
    let middle = surface.positions.iter().copied().sum::<Vec3>() / count;
    tissue.structure(name, surface, |_, position, border| {
        let beyond = position + (position - middle).normalize_or_zero() * (2.0 * spacing);
        match patch_at(beyond.normalize()) {
            _ if !border => Some(Hold::Loose),
            None => Some(Hold::Firm),
            Some(_) => None,
        }
    })
}

/// A muscle of the temple, half way between bone and skin: grown onto the temporal line all around.
fn muscle(layers: &Layers, name: &'static str, side: f32) -> Structure {
    let radius = |d: Vec3| 0.5 * (layers.outer.at(d) + layers.skin.at(d)) - 0.001;
    let surface = sheet(&radius, 0.007, |direction| temple(direction, side));
    MUSCLE.structure(name, surface, |_, _, border| border.then_some(Hold::Firm))
}

fn periosteum(layers: &Layers) -> Structure {
    let radius = |d: Vec3| layers.outer.at(d) + 0.5 * PERIOSTEUM.thickness;
    let surface =
        sheet(&radius, 0.007, |direction| direction.dot(site()) > 0.72 && !temple(direction, 1.0));
    PERIOSTEUM.structure("right periosteum", surface, |_, _, border| {
        Some(if border { Hold::Firm } else { Hold::Loose })
    })
}

/// The fold between the hemispheres: from the inside of the skull down to its free edge, which is deeper
/// at the back.
fn falx(layers: &Layers) -> Structure {
    const SPACING: f32 = 0.008;
    let scale = Scale::of(layers);
    let bounds = scale.inside(layers);
    // Not through the grid's own nodes.
    let off = 0.37 * SPACING;
    let surface = extract(&bounds, SPACING, |point| parts(point)[0] + off);
    let keep = |point: Vec3| {
        let [right, front, up] = parts(point);
        let (wall, length) = (layers.inner.at(point), point.length());
        let back = -front / length.max(1e-3);
        right.abs() < SPACING
            && length < wall - 0.001_5
            && length > wall * (0.62 - 0.2 * back)
            && up > -0.05 * length
            && up > tentorium(scale, 0.0, front) + 0.002
    };
    let (rounds, shares) = RELAX;
    let flat = |point: Vec3| point - RIGHT * parts(point)[0];
    let surface = surface.sheet(keep).relaxed(rounds, &shares, flat).upright(|_| RIGHT);
    DURA.structure("falx", surface, held_at_the_wall(layers))
}

/// The fold between cerebrum and cerebellum: around the notch that lets the brainstem through.
fn tentorium_sheet(layers: &Layers) -> Structure {
    const SPACING: f32 = 0.007;
    let scale = Scale::of(layers);
    let height = |point: Vec3| {
        let [right, front, up] = parts(point);
        up - tentorium(scale, right, front)
    };
    let surface = extract(&scale.inside(layers), SPACING, height);
    let keep = |point: Vec3| {
        let [right, front, _] = parts(point);
        let notch = right.abs() < 0.016 * scale.0 && front > -0.038 * scale.0;
        height(point).abs() < 0.5 * SPACING
            && point.length() < layers.inner.at(point) - 0.001_5
            && front < 0.0
            && !notch
    };
    let (rounds, shares) = RELAX;
    let surface =
        surface.sheet(keep).relaxed(rounds, &shares, |p| p - UP * height(p)).upright(|_| UP);
    DURA.structure("tentorium", surface, held_at_the_wall(layers))
}

/// Held on the border where it is near the inside of the skull.
fn held_at_the_wall(layers: &Layers) -> impl Fn(u32, Vec3, bool) -> Option<Hold> {
    |_, position, border| {
        let near = position.length() > layers.inner.at(position) - 0.012;
        (border && near).then_some(Hold::Firm)
    }
}
