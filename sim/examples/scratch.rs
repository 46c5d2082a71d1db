//! Scratch.
use dualframe_sim::behavior::*;
use dualframe_sim::blocking::Grain;
use dualframe_sim::executor::*;
use dualframe_sim::manager::*;
use dualframe_sim::render::NullRenderer;
use dualframe_sim::scene::craniotomy::*;
use dualframe_sim::scene::head::Head;
use std::sync::Arc;
use std::time::Instant;
fn main() {
    let step = std::env::args().nth(1).unwrap_or("all".into());
    let threads: usize = std::env::args().nth(2).and_then(|a| a.parse().ok()).unwrap_or(1);
    let step = Step::ALL.into_iter().find(|s| s.name() == step).unwrap();
    let t = Instant::now();
    let head = Arc::new(Head::synthetic().unwrap());
    println!("head {:?} skull {:?}", t.elapsed(), head.skull.dims());
    for (i, s) in head.structures.iter().enumerate() {
        println!(
            "{i} {} nodes {} tris {} pins {} mass {:.4} k {:.0}",
            s.name,
            s.positions.len(),
            s.triangles.len(),
            s.pins.len(),
            s.masses.iter().sum::<f32>(),
            s.stiffness
        );
    }
    println!(
        "burr hole {:?} outline {} thick {:?}",
        head.plan.burr_hole,
        head.plan.craniotomy.len(),
        head.plan.craniotomy.iter().map(|e| (e.thickness * 1e4) as i32).collect::<Vec<_>>()
    );
    let t = Instant::now();
    let scene = build(&head).unwrap();
    println!("build {:?}", t.elapsed());
    let mut op = Operation::new(head.clone(), Some(step));
    let settings = Settings {
        executor: if threads == 1 { ExecutorKind::Serial } else { ExecutorKind::Pipeline },
        threads,
        grain: Grain::Pairwise,
        ..Settings::default()
    };
    let mut m = VeManager::new(scene, settings).unwrap();
    println!("frames {}", op.frames());
    let t = Instant::now();
    while m.frame() < op.frames() {
        let n = LOOK_FRAMES.min(op.frames() - m.frame());
        let mut null = NullRenderer::new();
        let mailbox = m.mailbox();
        {
            let (hands, mut watch) = op.parts(&mut null);
            m.run(n, &mut watch, &mut |r| hands.swapped(r.frame, &mailbox)).unwrap();
        }
        let f = m.frame();
        m.visit(&mut |o| {
            if let Some(t) = Tool::of(o) {
                if o.id().0 == 0 {
                    let p = o.geometry.as_rigid().unwrap().pose.translation;
                    println!(
                        "{f} tool {:?} pressed {} at {:?} r-inner {:.4} force {:.2} turns {}",
                        t.instrument(),
                        t.is_pressed(),
                        p,
                        head.inner_at(p) - p.length(),
                        t.work().bone.length(),
                        t.work().turns
                    );
                }
            }
        });
        let (mm, c) = op.look(m, |s| VeManager::new(s, settings)).unwrap();
        m = mm;
        if c > 0 {
            println!("FREED {c} at {f}");
        }
    }
    let e = t.elapsed();
    println!(
        "{} frames {:?}: {:.1} fps, hash {:016x}",
        m.frame(),
        e,
        m.frame() as f64 / e.as_secs_f64(),
        m.state_hash()
    );
    println!("{:?}", m.quarantined());
    println!("{:?}", op.report());
    m.visit(&mut |o| {
        if o.id().0 >= 29 {
            println!("obj {} center {:?}", o.id(), o.center());
        }
    });
}
