use super::*;
use nalgebra::Matrix6;

/// Four boxes of 1 g to 1 kg in a chain of fixed joints that hangs from the world, moving and turning each its own way.
fn chain() -> (Vec<Body>, Vec<Bilateral>) {
    let masses_kg = [1e-3, 1.0, 1e-2, 0.1];
    let moving = masses_kg.iter().enumerate().map(|(number, mass_kg)| {
        let turn = Matrix6::from_diagonal(&Vector6::new(1.0, 1.0, 1.0, 600.0, 600.0, 600.0));
        let twist = Vector6::from_fn(|at, _| libm::sin((7 * number + 3 * at + 1) as f64));
        Body { twist, mobility: turn / *mass_kg }
    });
    let all: Vec<_> = [Body::default()].into_iter().chain(moving).collect();
    let joints = (1..all.len()).map(|child| {
        let arms_W_m = [Vector3::new(0.05, 0.0, 0.0), Vector3::new(-0.05, 0.01, 0.0)];
        let along = [Vector3::x(), Vector3::y(), Vector3::z()];
        let held = along.map(|along_W| Row::at(&all, [child - 1, child], arms_W_m, &along_W));
        let turned = along.map(|about_W| {
            let about = super::super::solver::join(&Vector3::zeros(), &about_W);
            Row::new(&all, [child - 1, child], [-about, about])
        });
        Bilateral::new(&[held, turned].concat()).unwrap()
    });
    let joints = joints.collect();
    (all, joints)
}

#[test]
fn an_island_of_joints_alone_is_solved_in_few_steps() {
    let (mut all, joints) = chain();
    let mobile = all.clone();
    let mut direct = Direct::default();
    direct.solve(&mut all, &mobile, &mut [], &joints, &[], |body| body > 0);
    let off_m_s = joints.iter().map(|joint| joint.off_m_s(&all)).fold(0.0, f64::max);
    assert!(off_m_s < 1e-9, "a rate is off by {off_m_s} m/s");
    let steps = direct.find_shifted();
    println!("{steps} steps");
    assert!(steps < 10, "{steps} steps of at most {STEPS_MAX}");
}
