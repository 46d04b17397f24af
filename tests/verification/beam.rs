use crate::analysis::run;

#[test]
fn quick() {
    let a = run("collapse.yaml", &[("method", "gimp"), ("update", "diagonal-corrected")]);
    for (i, s) in a.steps.iter().enumerate() {
        println!("{} {:?}", i + 1, s.residuals);
    }
    for (i, p) in a.points.converged.position.iter().enumerate() {
        let l = a.points.converged.half_lengths[i];
        if p[1] - l[1] < 1e-6 && p[0] > 10.0 {
            println!("{:?} {:?} {:e}", p, l, p[1] - l[1]);
        }
    }
}
