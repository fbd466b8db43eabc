//! Searches for grasps of a box in physics, without any learning (paper §II-A).
//!
//! `cargo run -p examples --example 04_grasp_search`

use grasps::RobotContext;
use grasps::search::{SearchConfig, SearchCounts, search};
use objects::Object;

fn main() -> anyhow::Result<()> {
    let robot = RobotContext::standard()?;
    let object = Object::from_catalog("sugar_box").expect("a built-in object");
    let config = SearchConfig::quick(&robot);
    let print = |counts: &SearchCounts| print!("\r{:3.0} %", 100.0 * counts.fraction);
    let (set, robust) = search(&robot, &object, &config, 0, &print)?;
    println!(
        "\r{} candidates, {} closed, {} tried, {} lifted",
        set.num_candidates, set.num_closed, set.num_tried, set.num_lifted
    );
    for scored in &robust {
        let palm = scored.grasp.object_from_palm.translation.vector;
        println!(
            "robust grasp, palm at {palm:.3?} in the object frame, {} of {} repeats lifted",
            scored.repeat_successes, config.num_repeats
        );
    }
    anyhow::ensure!(!robust.is_empty(), "no robust grasp was found");
    Ok(())
}
