//! Runs one attempt of the shipped policy: camera, encoder, policy, lift, hold.
//!
//! `cargo run -p examples --example 05_run_policy [OBJECT [SEED]]`

use anyhow::Context;
use objects::Object;
use policy::model::{CONFIG_FILE, STARTS_FILE, WEIGHTS_FILE};
use rollout::{Attempt, Controller, RolloutContext};

fn main() -> anyhow::Result<()> {
    let mut args = std::env::args().skip(1);
    let name = args.next().unwrap_or_else(|| "sugar_box".into());
    let seed = args.next().map_or(Ok(0), |text| text.parse())?;

    let mut context = RolloutContext::new()?;
    let folder = concat!(env!("CARGO_MANIFEST_DIR"), "/../models/default/");
    let read = |file: &str| std::fs::read(format!("{folder}{file}"));
    let model_hash =
        context.load_model(&read(WEIGHTS_FILE)?, &read(STARTS_FILE)?, &read(CONFIG_FILE)?)?;
    println!("model {}", &model_hash[..8]);

    let object =
        Object::from_catalog(&name).with_context(|| format!("no built-in object {name}"))?;
    let mut attempt = Attempt::new(&context, &object, &name, None, seed, Controller::Policy)?;
    println!("{} points in the cloud, object at {:.3?}", attempt.cloud().len(), attempt.pose());
    let mut phase = None;
    while attempt.outcome().is_none() {
        attempt.step(&context);
        if phase != Some(attempt.phase()) {
            phase = Some(attempt.phase());
            println!("{:5.2} s  {:?}", attempt.ticks() as f64 / 30.0, attempt.phase());
        }
    }
    println!("{:?}", attempt.outcome());
    println!("final state {}", &attempt.state_hash()[..8]);
    Ok(())
}
