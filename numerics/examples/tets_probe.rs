//! probe
use cpu_time::ProcessTime;
use numerics::tets::*;
fn load(path: &str) -> (Vec<u32>, Vec<u32>, Vec<[f32; 3]>) {
    let text = std::fs::read_to_string(path).unwrap();
    let (mut s, mut c, mut p) = (vec![0], vec![], vec![]);
    for line in text.lines() {
        let mut w = line.split_whitespace();
        match w.next() {
            Some("v") => { let v: Vec<f32> = w.take(3).map(|x| x.parse().unwrap()).collect(); p.push([v[0], v[1], v[2]]); }
            Some("f") => { for x in w { c.push(x.split('/').next().unwrap().parse::<u32>().unwrap() - 1); } s.push(c.len() as u32); }
            _ => {}
        }
    }
    (s, c, p)
}
fn main() {
    for name in std::env::args().skip(1) {
        let (s, c, p) = load(&name);
        let t = ProcessTime::now();
        let w = std::time::Instant::now();
        let closed = match Closed::of(&Surface { starts: &s, corners: &c, points: &p }, true) { Ok(c) => c, Err(e) => { println!("{name}: {e}; {}", e.hint()); continue } };
        let t1 = t.elapsed();
        println!("{name}: {:?} volume {} edge {}", closed.changes, closed.volume(), closed.mean_edge());
        for interior in [true, false] {
            let t = ProcessTime::now();
            let w1 = std::time::Instant::now();
            let solid = closed.fill(&Fill { spacing: 0.0, interior }).unwrap();
            println!("  close {:?} fill cpu {:?} wall {:?} total {:?} points {} tets {} {:?}", t1, t.elapsed(), w1.elapsed(), w.elapsed(), solid.points.len(), solid.tets.len(), solid.measured);
            if std::env::var_os("Q").is_some() {
            let n = p.len() as u32;
            let mut q = vec![vec![]; 5];
            for tet in &solid.tets { let k = tet.iter().filter(|c| **c < n).count(); q[k].push(numerics::tets::quality_of(&tet.map(|c| solid.points[c as usize].map(f64::from)))); }
            for (k, q) in q.iter_mut().enumerate() { if q.is_empty() { continue; } q.sort_by(f64::total_cmp); let n = q.len(); println!("    {k} on surface: {n} q min {:.4} p1 {:.3} p5 {:.3} p25 {:.3} med {:.3} p75 {:.3}", q[0], q[n/100], q[n/20], q[n/4], q[n/2], q[3*n/4]); }
            }
        }
    }
}
