//! Scenes at the edge of what numbers can say, by the thousand, each checked against the `f64` reference, a closed form
//! or an identity that holds for any renderer.
//!
//! Everything is drawn from a seed, and a failure names it: `OSTEOTOME_STRESS_SEED=17 cargo test -p tests NAME` runs that
//! one case of a test again. `OSTEOTOME_STRESS=20` runs twenty times as many cases. `drawers` lists the renderers under
//! test; what holds for one holds for all.

mod cases;
mod closed;
mod drawers;
mod grids;
mod identities;
mod judge;
mod parts;
mod pictures;
mod random;
mod shapes;
mod solids;
mod textures;

use random::Random;

/// Runs `check` with the random numbers of `count` seeds and fails with every seed that it refused, and why.
fn each(what: &str, count: u64, check: impl Fn(&mut Random) -> Result<(), String>) {
    let number = |name: &str| std::env::var(name).ok().and_then(|text| text.parse::<u64>().ok());
    let seeds = match number("OSTEOTOME_STRESS_SEED") {
        Some(seed) => seed..seed + 1,
        None => 0..count * number("OSTEOTOME_STRESS").unwrap_or(1),
    };
    let total = seeds.end - seeds.start;
    let failed: Vec<String> = seeds
        .filter_map(|seed| {
            let fault = check(&mut Random::new(what, seed)).err()?;
            Some(format!("seed {seed}: {fault}"))
        })
        .collect();
    let shown = failed.iter().take(30).cloned().collect::<Vec<_>>().join("\n  ");
    assert!(failed.is_empty(), "{what}: {} of {total} cases fail\n  {shown}", failed.len());
}
