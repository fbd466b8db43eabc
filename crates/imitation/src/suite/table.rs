//! A suite in words: Markdown.

use super::{Suite, paired};
use crate::evaluation::{Report, Row};
use crate::spread::median;
use std::fmt::Write;

/// What was tried, the counts, the comparisons with the first policy, how they moved, and why they failed.
pub fn table(suite: &Suite) -> String {
    let (policies, objects) = (suite.policies(), suite.objects());
    let mut text = tried(suite);
    row(&mut text, "acts", objects.iter().map(|object| object.replace('_', " ")));
    row(&mut text, "---", objects.iter().map(|_| "---".to_owned()));
    for policy in &policies {
        let counts =
            objects.iter().map(|object| suite.report(policy, object).map_or(none(), count));
        row(&mut text, policy, counts);
    }
    let first = policies.first().copied().unwrap_or_default();
    let _ = write!(
        text,
        "\nIntervals are Wilson's at 95 %. Compared with {first} from the same seeds: how often it alone lifted, how \
         often the other alone, and the probability of so uneven a split by chance (McNemar, exact).\n\n"
    );
    row(&mut text, "acts", objects.iter().map(|object| object.replace('_', " ")));
    row(&mut text, "---", objects.iter().map(|_| "---".to_owned()));
    for policy in policies.iter().skip(1) {
        let compared = objects.iter().map(|object| {
            let pair = suite.report(first, object).zip(suite.report(policy, object));
            pair.map_or(none(), |(a, b)| {
                let found = paired(a, b);
                format!("{} : {}, p = {:.2e}", found.first, found.second, found.p)
            })
        });
        row(&mut text, policy, compared);
    }
    text.push_str(
        "\nOf the motion into the grasp: median duration, path, jerk and least distance from table and object before \
         the hand closes (more than 100 mm is not measured); reasons of failure.\n\n",
    );
    let head = ["object", "s", "rad", "rad/s³", "mm", "failures"];
    row(&mut text, "acts", head.map(str::to_owned).into_iter());
    row(&mut text, "---", head.map(|_| "---".to_owned()).into_iter());
    for report in &suite.reports {
        let of = |value: &dyn Fn(&Row) -> Option<f64>| {
            let values = report.rows.iter().filter_map(value).collect();
            median(values).map_or(none(), |median| format!("{median:.1}"))
        };
        let reasons: Vec<String> = report
            .failures
            .iter()
            .map(|(reason, n)| format!("{n} {}", reason.replace('_', " ")))
            .collect();
        let cells = [
            report.object.replace('_', " "),
            of(&|row| row.motion.map(|motion| motion.seconds)),
            of(&|row| row.motion.map(|motion| motion.path)),
            of(&|row| row.motion.map(|motion| motion.jerk)),
            of(&|row| row.clearance.map(|gap| 1e3 * f64::from(gap))),
            reasons.join(", "),
        ];
        row(&mut text, &report.policy, cells.into_iter());
    }
    text
}

/// Attempts and seeds; which scene, and what acted in it, in the first digits of their hashes.
fn tried(suite: &Suite) -> String {
    let Some(Report { attempts, seed, scene_hash, .. }) = suite.reports.first() else {
        return String::new();
    };
    let last = seed + (*attempts as u64).saturating_sub(1);
    let digits = |hash: &str| hash.chars().take(8).collect::<String>();
    let mut acts: Vec<String> = Vec::new();
    for Report { policy, model_hash, .. } in &suite.reports {
        // A planner acts by other grasps for each object.
        let by = model_hash.as_deref().map_or(none(), digits);
        let act = format!("{policy} {by}");
        if !acts.contains(&act) {
            acts.push(act);
        }
    }
    format!(
        "{attempts} attempts of each on each object, seeds {seed} to {last}, scene {}. Who acts, and the hash of what \
         by: {}.\n\n![Shares of attempts that lifted](suite.svg)\n\n",
        digits(scene_hash),
        acts.join(", ")
    )
}

fn row(text: &mut String, first: &str, cells: impl Iterator<Item = String>) {
    let cells: Vec<String> = cells.collect();
    // Writing to a string cannot fail.
    let _ = writeln!(text, "| {first} | {} |", cells.join(" | "));
}

fn none() -> String {
    "–".to_owned()
}

/// k of n and the interval.
fn count(report: &Report) -> String {
    let [low, high] = report.wilson95.map(|share| 100.0 * share);
    format!("{} of {} ({low:.0} to {high:.0} %)", report.lifted, report.attempts)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::suite::samples::report;

    #[test]
    fn every_policy_has_a_row_and_what_was_not_tried_a_dash() {
        let suite = Suite {
            reports: vec![
                report("ngf-pcd", "sugar_box", &[true; 4]),
                report("ngf-pcd", "mustard", &[true, false, true, false]),
                report("mlp-pcd", "sugar_box", &[false, false, true, true]),
            ],
        };
        let text = table(&suite);
        assert!(text.starts_with("4 attempts of each on each object, seeds 0 to 3, scene scene."));
        assert!(text.contains("by: ngf-pcd –, mlp-pcd –."), "{text}");
        assert!(
            text.contains("| ngf-pcd | 4 of 4 (51 to 100 %) | 2 of 4 (15 to 85 %) |"),
            "{text}"
        );
        assert!(text.contains("| mlp-pcd | 2 of 4 (15 to 85 %) | – |"), "{text}");
        assert!(text.contains("| mlp-pcd | 2 : 0, p = 5.00e-1 | – |"), "{text}");
        assert!(text.contains("| ngf-pcd | mustard | – | – | – | – | 2 missed |"), "{text}");
    }
}
