//! Metrics in the text format of Prometheus (version 0.0.4), converted from OpenMetrics text.

/// Media type of OpenMetrics text.
pub(super) const OPEN_METRICS: &str = "application/openmetrics-text; version=1.0.0; charset=utf-8";

/// Media type of the text format of Prometheus.
pub(super) const PROMETHEUS: &str = "text/plain; version=0.0.4; charset=utf-8";

/// Whether an `Accept` header names OpenMetrics. All other clients get the older format, which all read.
pub(super) fn accepts_open_metrics(accept: &str) -> bool {
    accept.split(',').any(|range| {
        let kind = range.split(';').next().unwrap_or_default().trim();
        kind.eq_ignore_ascii_case("application/openmetrics-text") && !range.contains("q=0.0")
    })
}

/// Converts OpenMetrics text. The names of counters and infos include their suffix, an info is a gauge, and units
/// and the end mark do not exist.
pub(super) fn from_open_metrics(text: &str) -> String {
    let mut out = String::with_capacity(text.len());
    // HELP precedes TYPE in OpenMetrics, and the suffix follows from the type.
    let mut help = None;
    for line in text.lines() {
        let mut words = line.splitn(4, ' ');
        match (words.next(), words.next(), words.next(), words.next()) {
            (Some("#"), Some("HELP"), Some(name), Some(text)) => help = Some((name, text)),
            (Some("#"), Some("TYPE"), Some(name), Some(kind)) => {
                let (suffix, kind) = match kind {
                    "counter" => ("_total", kind),
                    "info" => ("_info", "gauge"),
                    _ => ("", kind),
                };
                if let Some((_, text)) = help.take_if(|(of, _)| *of == name) {
                    out += &format!("# HELP {name}{suffix} {text}\n");
                }
                out += &format!("# TYPE {name}{suffix} {kind}\n");
            }
            (Some("#"), Some("UNIT" | "EOF"), ..) => {}
            _ => {
                out += line;
                out.push('\n');
            }
        }
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn open_metrics_is_used_only_if_it_is_named() {
        let prometheus =
            "application/openmetrics-text;version=1.0.0;q=0.5,text/plain;version=0.0.4";
        assert!(accepts_open_metrics(prometheus));
        for accept in ["", "*/*", "text/plain", "application/openmetrics-texts"] {
            assert!(!accepts_open_metrics(accept), "{accept}");
        }
    }

    #[test]
    fn counters_and_infos_are_named_with_their_suffix() {
        let text = "# HELP ngf_build Version.\n# TYPE ngf_build info\nngf_build_info{version=\"1\"} 1\n\
                    # HELP ngf_upload_bytes Size.\n# TYPE ngf_upload_bytes counter\n\
                    # UNIT ngf_upload_bytes bytes\nngf_upload_bytes_total 7\n# EOF\n";
        assert_eq!(
            from_open_metrics(text),
            "# HELP ngf_build_info Version.\n# TYPE ngf_build_info gauge\n\
             ngf_build_info{version=\"1\"} 1\n# HELP ngf_upload_bytes_total Size.\n\
             # TYPE ngf_upload_bytes_total counter\nngf_upload_bytes_total 7\n"
        );
    }
}
