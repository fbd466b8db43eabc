//! `ngf replay`: a recorded episode through physics again, or the attempt of a link.

use crate::evaluate::load;
use crate::link::Link;
use crate::objects::{self, ObjectOptions};
use anyhow::{Context, Result, bail, ensure};
use dataset::generate::built_in_object;
use geometry::brought;
use rollout::{Attempt, Controller, Episode, Verdict, Workcell};
use scene::config::scene_hash;

/// What to replay, or to record.
#[derive(clap::Args)]
pub(crate) struct Options {
    /// Episode file, or a link of the page to an attempt.
    #[arg(value_name = "FILE|LINK")]
    what: String,
    /// Record an attempt of the planner on this built-in object into the file first.
    #[arg(long, value_name = "NAME")]
    record: Option<String>,
    /// Seed of the recorded attempt.
    #[arg(long, default_value_t = 0)]
    seed: u64,
    /// Model instead of the link's: a folder of models/ or any folder.
    #[arg(long, value_name = "MODEL")]
    model: Option<String>,
    /// The file that a link or an episode is about, if it is about one; of an episode the object as it was.
    #[command(flatten)]
    object: ObjectOptions,
}

/// Replays and prints verdict and final state hash; other ones than were recorded are an error.
pub(crate) fn run(options: &Options) -> Result<()> {
    if Link::is_one(&options.what) {
        return follow(&Link::parse(&options.what)?, options);
    }
    let workcell = Workcell::new()?;
    let file = std::path::Path::new(&options.what);
    if let Some(name) = &options.record {
        let object = built_in_object(name)?;
        let mut attempt =
            Attempt::begin(&workcell, &object, name, None, options.seed, Controller::Planner)?;
        attempt.run(&workcell);
        dataset::store::write(file, &serde_json::to_vec(&attempt.episode())?)?;
    }
    let bytes = std::fs::read(file).with_context(|| format!("cannot read {}", file.display()))?;
    let episode: Episode = serde_json::from_slice(&bytes)
        .with_context(|| format!("{} is not an episode", file.display()))?;
    let object = match options.object.load_any()? {
        Some(given) => given.object,
        None => built_in_object(&episode.name)
            .context("the episode is about a file: give it with --mesh and --mass")?,
    };
    let (verdict, hash) = episode.replay(&workcell, &object)?;
    println!("{}", words(verdict));
    println!("{hash}");
    if hash != episode.state_hash {
        bail!("the recording ended in {}", episode.state_hash);
    }
    if verdict != episode.verdict {
        bail!("the recording ended otherwise: {}", words(episode.verdict));
    }
    Ok(())
}

/// Makes the attempt of a link again.
fn follow(link: &Link, options: &Options) -> Result<()> {
    ensure!(
        link.scene == scene_hash(),
        "the link was made with another scene or robot: use the version of this program that it was made with"
    );
    let mut workcell = Workcell::new()?;
    let model = load(&mut workcell, options.model.as_deref().unwrap_or(&link.model))?;
    ensure!(
        link.model_hash.as_ref().is_none_or(|hash| *hash == model),
        "the model is not the one of the link: name that one with --model"
    );
    let name = &link.object;
    let object = match options.object.mesh_alone()? {
        Some(file) => {
            let bytes =
                objects::read(file).with_context(|| format!("cannot read {}", file.display()))?;
            let found = brought::read(name, &bytes, link.told, &mut ());
            found.with_context(|| format!("{} cannot be used", file.display()))?.object
        }
        None => built_in_object(name).context("the link is about a file: give it with --mesh")?,
    };
    ensure!(
        link.object_hash == object.hash(),
        "what is given is not {name} as it was: its shape or mass is another"
    );
    let (pose, policy) = (Some(link.pose), Controller::Policy);
    let mut attempt = Attempt::begin(&workcell, &object, name, pose, link.seed, policy)?;
    let verdict = attempt.run(&workcell);
    let hash = attempt.state_hash();
    println!("{}", verdict.words());
    println!("{hash}");
    ensure!(hash == link.end, "in the link it ended in {}", link.end);
    Ok(())
}

fn words(verdict: Option<Verdict>) -> &'static str {
    verdict.map_or("No verdict.", |verdict| verdict.words())
}
