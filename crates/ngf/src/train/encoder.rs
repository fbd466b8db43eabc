//! The autoencoder, and what it is worth afterwards.

use super::log::Log;
use super::{Run, STOPPED};
use anyhow::{Result, bail};
use dataset::Dataset;
use dataset::generate::built_in_object;
use dataset::store;
use geometry::object::Object;
use grasps::Robot;
use imitation::autoencoder::{self, AutoencoderConfig};
use imitation::encoder::TrainedEncoder;
use imitation::readout::readout;
use imitation::reconstruction::picture;
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use std::path::Path;

/// Trains and examines it.
pub(super) fn train(run: &Run) -> Result<()> {
    let mut config =
        AutoencoderConfig { threads: run.threads, seed: run.seed, ..AutoencoderConfig::standard() };
    config.steps = run.steps.unwrap_or(config.steps);
    config.batch = run.batch.unwrap_or(config.batch);
    config.rate = run.rate.unwrap_or(config.rate);
    config.span = run.checkpoint.map_or(config.span, |steps| steps as u64);
    let dataset = Dataset::open(&run.data)?;
    let mut log = Log::open(&run.out, "encoder", "chamfer", config.batch)?;
    if !autoencoder::train(&dataset, &config, &run.out, &mut log)? {
        bail!(STOPPED);
    }
    examine(&run.out, &dataset.config.encoder_objects)
}

/// Views of an object to which a read-out of the pose is fitted, and on which it is tried.
const VIEWS: usize = 1000;

/// Draws what the autoencoder makes of clouds, and says what a linear read-out of z tells of the pose of each object,
/// and of one that the encoder has not seen.
fn examine(out: &Path, names: &[String]) -> Result<()> {
    let (encoder, robot) = (TrainedEncoder::load(out)?, Robot::standard()?);
    let mut report = serde_json::Map::new();
    let is_variant = |name: &&str| name.contains('.');
    let seen = names.iter().map(String::as_str).filter(|name| !is_variant(name));
    let unseen = ["mustard"].into_iter().filter(|name| !names.iter().any(|seen| seen == name));
    // A mesh of somebody's is no longer at hand.
    let known = |name| Some((name, built_in_object(name).ok()?));
    let objects: Vec<(&str, Object)> = seen.chain(unseen).filter_map(known).collect();
    let picture = picture(&encoder, &robot, &objects, &mut ChaCha8Rng::seed_from_u64(1))?;
    store::write(&out.join("encoder.svg"), picture.as_bytes())?;
    for (name, object) in objects {
        let mut rng = ChaCha8Rng::seed_from_u64(0);
        let found = readout(&encoder, &robot, &object, VIEWS, &mut rng)?;
        let [median, p90] = found.position.map(|x| 1e3 * x);
        print!("{name}: position off by {median:.1} mm (median), {p90:.1} mm (p90)");
        match found.yaw.map(|yaw| yaw.map(f64::to_degrees)) {
            Some([median, p90]) => println!("; yaw by {median:.1} and {p90:.1} degrees"),
            None => println!("; round"),
        }
        report.insert(name.to_owned(), serde_json::to_value(found)?);
    }
    store::write(&out.join("encoder.report.json"), &serde_json::to_vec_pretty(&report)?)
}
