//! Markdown report of a comparison.

use super::{Comparison, paired_test};
use crate::percentiles::median;
use crate::{AttemptResult, EvaluationReport};
use std::fmt::Write;

/// Markdown with protocol, success counts, paired tests against the first policy, motion metrics and failure
/// reasons.
pub fn markdown_report(suite: &Comparison) -> String {
    let (policies, objects) = (suite.policies(), suite.objects());
    let mut text = header(suite);
    push_row(&mut text, "policy", objects.iter().map(|object| object.replace('_', " ")));
    push_row(&mut text, "---", objects.iter().map(|_| "---".to_owned()));
    for policy in &policies {
        let counts =
            objects.iter().map(|object| suite.report(policy, object).map_or(dash(), success_cell));
        push_row(&mut text, policy, counts);
    }
    let first = policies.first().copied().unwrap_or_default();
    let _ = write!(
        text,
        "\n95 % Wilson intervals. Paired comparison with {first} on the same seeds: seeds at which only {first} lifted : \
         seeds at which only the other policy lifted, and the p-value (McNemar, exact).\n\n"
    );
    push_row(&mut text, "policy", objects.iter().map(|object| object.replace('_', " ")));
    push_row(&mut text, "---", objects.iter().map(|_| "---".to_owned()));
    for policy in policies.iter().skip(1) {
        let compared = objects.iter().map(|object| {
            let pair = suite.report(first, object).zip(suite.report(policy, object));
            pair.map_or(dash(), |(a, b)| {
                let found = paired_test(a, b);
                format!("{} : {}, p = {:.2e}", found.first_only, found.second_only, found.p_value)
            })
        });
        push_row(&mut text, policy, compared);
    }
    text.push_str(
        "\nMotion to the grasp: median duration, path length, jerk, and min. clearance to table and object before the \
         hand closes (measured up to 100 mm); number of failures by reason.\n\n",
    );
    let head = ["object", "s", "rad", "rad/s³", "mm", "failures"];
    push_row(&mut text, "policy", head.map(str::to_owned).into_iter());
    push_row(&mut text, "---", head.map(|_| "---".to_owned()).into_iter());
    for report in &suite.reports {
        let of = |value: &dyn Fn(&AttemptResult) -> Option<f64>| {
            let values = report.rows.iter().filter_map(value).collect();
            median(values).map_or(dash(), |median| format!("{median:.1}"))
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
            of(&|row| row.clearance.map(|clearance| 1e3 * f64::from(clearance))),
            reasons.join(", "),
        ];
        push_row(&mut text, &report.policy, cells.into_iter());
    }
    text
}

/// Number of attempts, seeds, and the first digits of the hashes of the scene and of the policies' inputs.
fn header(suite: &Comparison) -> String {
    let Some(EvaluationReport { attempts, seed, scene_hash, .. }) = suite.reports.first() else {
        return String::new();
    };
    let last = seed + (*attempts as u64).saturating_sub(1);
    let digits = |hash: &str| hash.chars().take(8).collect::<String>();
    let mut inputs: Vec<String> = Vec::new();
    for EvaluationReport { policy, model_hash, .. } in &suite.reports {
        // The planner uses different grasps for each object, so it can have several hashes.
        let hash = model_hash.as_deref().map_or(dash(), digits);
        let input = format!("{policy} {hash}");
        if !inputs.contains(&input) {
            inputs.push(input);
        }
    }
    format!(
        "{attempts} attempts per policy and object, seeds {seed} to {last}, scene {}. Policies and hashes of their \
         inputs: {}.\n\n![Success rates](comparison.svg)\n\n",
        digits(scene_hash),
        inputs.join(", ")
    )
}

fn push_row(text: &mut String, first: &str, cells: impl Iterator<Item = String>) {
    let cells: Vec<String> = cells.collect();
    // Writing to a string cannot fail.
    let _ = writeln!(text, "| {first} | {} |", cells.join(" | "));
}

fn dash() -> String {
    "–".to_owned()
}

/// "k of n", with the 95 % Wilson interval in percent.
fn success_cell(report: &EvaluationReport) -> String {
    let [low, high] = report.wilson95.map(|rate| 100.0 * rate);
    format!("{} of {} ({low:.0} to {high:.0} %)", report.lifted, report.attempts)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::comparison::fixtures::report;

    #[test]
    fn table_has_a_row_per_policy_and_a_dash_for_missing_reports() {
        let suite = Comparison {
            reports: vec![
                report("ngf-pcd", "sugar_box", &[true; 4]),
                report("ngf-pcd", "mustard", &[true, false, true, false]),
                report("mlp-pcd", "sugar_box", &[false, false, true, true]),
            ],
        };
        let text = markdown_report(&suite);
        assert!(text.starts_with("4 attempts per policy and object, seeds 0 to 3, scene scene."));
        assert!(text.contains("inputs: ngf-pcd –, mlp-pcd –."), "{text}");
        assert!(
            text.contains("| ngf-pcd | 4 of 4 (51 to 100 %) | 2 of 4 (15 to 85 %) |"),
            "{text}"
        );
        assert!(text.contains("| mlp-pcd | 2 of 4 (15 to 85 %) | – |"), "{text}");
        assert!(text.contains("| mlp-pcd | 2 : 0, p = 5.00e-1 | – |"), "{text}");
        assert!(text.contains("| ngf-pcd | mustard | – | – | – | – | 2 missed |"), "{text}");
    }
}
