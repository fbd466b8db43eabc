//! Command line of a worker: the `ngf` command that performs a job.

use crate::job::{ObjectParams, Params};
use std::path::Path;

/// Paths of the inputs of a job: absolute, or relative to the job folder.
#[derive(Clone, Debug, Default)]
pub(super) struct InputPaths<'a> {
    /// Folder of the dataset.
    pub(super) dataset: Option<&'a Path>,
    /// Folder of the encoder or the model.
    pub(super) model: Option<&'a Path>,
    /// File of the mesh.
    pub(super) mesh: Option<&'a Path>,
}

/// Output folder, relative to the job folder.
pub(super) const OUT_DIR: &str = "out";

/// Report file of an evaluation, in [`OUT_DIR`].
pub(super) const REPORT_FILE: &str = "report.json";

/// Arguments of `ngf` for a job.
pub(super) fn argv(params: &Params, inputs: &InputPaths) -> Vec<String> {
    let mut argv: Vec<String> = Vec::new();
    let mut push = |args: &[&str]| argv.extend(args.iter().map(|arg| (*arg).to_owned()));
    let path = |path: Option<&Path>| path.unwrap_or(Path::new("")).display().to_string();
    match params {
        Params::Dataset(params) => {
            push(&[
                "dataset",
                "generate",
                "--preset",
                &params.preset,
                "--out",
                OUT_DIR,
                "--resume",
            ]);
            push(&["--seed", &params.seed.to_string()]);
            push(&["--threads", &params.threads.to_string()]);
            params.object_params.argv(inputs.mesh).iter().for_each(|arg| push(&[arg]));
        }
        Params::Encoder(params) => {
            push(&["train", "encoder", "--dataset", &path(inputs.dataset), "--out", OUT_DIR]);
            params.training.argv().iter().for_each(|arg| push(&[arg]));
        }
        Params::Policy(params) => {
            push(&["train", "policy", "--dataset", &path(inputs.dataset), "--out", OUT_DIR]);
            push(&["--encoder", &path(inputs.model), "--policy", &params.policy]);
            if let Some(horizon) = params.horizon {
                push(&["--horizon", &horizon.to_string()]);
            }
            params.training.argv().iter().for_each(|arg| push(&[arg]));
        }
        Params::Evaluation(params) => {
            let model = match params.model_id.as_str() {
                "planner" => "planner".to_owned(),
                _ => path(inputs.model),
            };
            push(&["evaluate", "--model", &model]);
            params.object_params.argv(inputs.mesh).iter().for_each(|arg| push(&[arg]));
            push(&["--attempts", &params.attempts.to_string()]);
            push(&["--seed", &params.seed.to_string()]);
            push(&["--json", &format!("{OUT_DIR}/{REPORT_FILE}")]);
            if params.controls {
                push(&["--controls"]);
            }
        }
        Params::Mesh(_) => push(&["mesh", "inspect", &path(inputs.mesh), "--out", OUT_DIR]),
    }
    argv
}

/// `--name value`; empty without a value.
fn option_args(name: &str, value: Option<String>) -> impl Iterator<Item = String> {
    value.map(|value| [format!("--{name}"), value]).into_iter().flatten()
}

impl ObjectParams {
    /// Options that select the object.
    fn argv(&self, mesh: Option<&Path>) -> Vec<String> {
        option_args("object", self.object.clone())
            .chain(option_args("mesh", mesh.map(|file| file.display().to_string())))
            .chain(option_args("mass", self.mass_kg.map(|mass| mass.to_string())))
            .chain(option_args("density", self.density_kg_m3.map(|density| density.to_string())))
            .collect()
    }
}

/// The command as a shell line for the log. Paths inside `folders` are shown relative to them: clients do not
/// need the layout of the server's disk.
pub(super) fn display(argv: &[String], folders: &[&Path]) -> String {
    let relative = |arg: &String| {
        let path = Path::new(arg);
        let inside = folders.iter().find_map(|folder| path.strip_prefix(folder).ok());
        shell_quote(&inside.unwrap_or(path).display().to_string())
    };
    let args: Vec<String> = argv.iter().map(relative).collect();
    format!("ngf {}", args.join(" "))
}

/// Quotes an argument for a POSIX shell if necessary.
fn shell_quote(arg: &str) -> String {
    let is_safe = |c: char| c.is_ascii_alphanumeric() || "_-./:=,+%@".contains(c);
    if !arg.is_empty() && arg.chars().all(is_safe) {
        return arg.to_owned();
    }
    format!("'{}'", arg.replace('\'', "'\\''"))
}

impl crate::job::TrainingParams {
    /// Options of a training command.
    fn argv(&self) -> Vec<String> {
        option_args("steps", self.steps.map(|x| x.to_string()))
            .chain(option_args("batch", self.batch.map(|x| x.to_string())))
            .chain(option_args("lr", self.learning_rate.map(|x| x.to_string())))
            .chain(option_args("checkpoint-every", self.checkpoint_every.map(|x| x.to_string())))
            .chain(option_args("threads", Some(self.threads.to_string())))
            .chain(option_args("seed", Some(self.seed.to_string())))
            .collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn displayed_command_is_shell_quoted_and_hides_server_folders() {
        let argv = ["evaluate", "--model", "/home/me/models/default", "--mesh"];
        let argv: Vec<String> = argv
            .into_iter()
            .chain(["/data/jobs/1/it's a mug.obj", ""])
            .map(str::to_owned)
            .collect();
        let folders = [Path::new("/data/jobs/1"), Path::new("/data"), Path::new("/home/me/models")];
        let line = display(&argv, &folders);
        assert_eq!(line, r"ngf evaluate --model default --mesh 'it'\''s a mug.obj' ''");
    }
}
