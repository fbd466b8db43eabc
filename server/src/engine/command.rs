//! The command that does a job: the one that a person would type.

use crate::job::{Params, Subject};
use std::path::Path;

/// Where a job finds what it works on. Everything is relative to the job's folder or absolute.
#[derive(Clone, Debug, Default)]
pub(super) struct Given<'a> {
    /// Folder of the dataset.
    pub(super) dataset: Option<&'a Path>,
    /// Folder of the encoder's or the model's files.
    pub(super) model: Option<&'a Path>,
    /// File of the mesh.
    pub(super) mesh: Option<&'a Path>,
}

/// Folder of what comes of a job, in the job's folder.
pub(super) const OUT: &str = "out";

/// The report of an evaluation, in [`OUT`].
pub(super) const REPORT: &str = "report.json";

/// Arguments of `ngf`.
pub(super) fn arguments(params: &Params, given: &Given) -> Vec<String> {
    let mut words: Vec<String> = Vec::new();
    let mut say = |some: &[&str]| words.extend(some.iter().map(|word| (*word).to_owned()));
    let path = |path: Option<&Path>| path.unwrap_or(Path::new("")).display().to_string();
    match params {
        Params::Dataset(params) => {
            say(&["dataset", "--preset", &params.preset, "--out", OUT, "--resume"]);
            say(&["--seed", &params.seed.to_string()]);
            say(&["--threads", &params.threads.to_string()]);
            params.subject.words(given.mesh).iter().for_each(|word| say(&[word]));
        }
        Params::Encoder(params) => {
            say(&["train", "encoder", "--data", &path(given.dataset), "--out", OUT]);
            params.course.words().iter().for_each(|word| say(&[word]));
        }
        Params::Policy(params) => {
            say(&["train", "policy", "--data", &path(given.dataset), "--out", OUT]);
            say(&["--encoder", &path(given.model), "--policy", &params.policy]);
            if let Some(horizon) = params.horizon {
                say(&["--horizon", &horizon.to_string()]);
            }
            params.course.words().iter().for_each(|word| say(&[word]));
        }
        Params::Evaluation(params) => {
            let model = match params.model_id.as_str() {
                "planner" => "planner".to_owned(),
                _ => path(given.model),
            };
            say(&["evaluate", "--model", &model]);
            params.subject.words(given.mesh).iter().for_each(|word| say(&[word]));
            say(&["--attempts", &params.attempts.to_string()]);
            say(&["--seed", &params.seed.to_string()]);
            say(&["--json", &format!("{OUT}/{REPORT}")]);
            if params.controls {
                say(&["--controls"]);
            }
        }
        Params::Mesh(_) => say(&["mesh", &path(given.mesh), "--out", OUT]),
    }
    words
}

/// An option of the command line, if it has a value.
fn option(name: &str, value: Option<String>) -> impl Iterator<Item = String> {
    value.map(|value| [format!("--{name}"), value]).into_iter().flatten()
}

impl Subject {
    /// As options of what works on an object.
    fn words(&self, mesh: Option<&Path>) -> Vec<String> {
        option("object", self.object.clone())
            .chain(option("mesh", mesh.map(|file| file.display().to_string())))
            .chain(option("mass", self.mass_kg.map(|mass| mass.to_string())))
            .chain(option("density", self.density_kg_m3.map(|density| density.to_string())))
            .collect()
    }
}

/// The command as a terminal takes it; what lies in one of these folders is named from there, for nobody but the server
/// needs to know where that is.
pub(super) fn words(arguments: &[String], folders: &[&Path]) -> String {
    let word = |argument: &String| {
        let path = Path::new(argument);
        let inside = folders.iter().find_map(|folder| path.strip_prefix(folder).ok());
        quoted(&inside.unwrap_or(path).display().to_string())
    };
    let words: Vec<String> = arguments.iter().map(word).collect();
    format!("ngf {}", words.join(" "))
}

fn quoted(word: &str) -> String {
    let is_plain = |c: char| c.is_ascii_alphanumeric() || "_-./:=,+%@".contains(c);
    if !word.is_empty() && word.chars().all(is_plain) {
        return word.to_owned();
    }
    format!("'{}'", word.replace('\'', "'\\''"))
}

impl crate::job::Course {
    /// As options of a training.
    fn words(&self) -> Vec<String> {
        option("steps", self.steps.map(|x| x.to_string()))
            .chain(option("batch", self.batch.map(|x| x.to_string())))
            .chain(option("rate", self.rate.map(|x| x.to_string())))
            .chain(option("checkpoint", self.checkpoint.map(|x| x.to_string())))
            .chain(option("threads", Some(self.threads.to_string())))
            .chain(option("seed", Some(self.seed.to_string())))
            .collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_command_is_told_as_a_terminal_takes_it_and_without_where_things_lie() {
        let arguments = ["evaluate", "--model", "/home/me/models/default", "--mesh"];
        let arguments: Vec<String> = arguments
            .into_iter()
            .chain(["/data/jobs/1/it's a mug.obj", ""])
            .map(str::to_owned)
            .collect();
        let folders = [Path::new("/data/jobs/1"), Path::new("/data"), Path::new("/home/me/models")];
        let told = words(&arguments, &folders);
        assert_eq!(told, r"ngf evaluate --model default --mesh 'it'\''s a mug.obj' ''");
    }
}
