//! Settings of the systemd unit: open files, and permissions of new files.

use crate::root;
use std::fs::read_to_string;

/// Value of a setting in the section `[Service]`; of several values, systemd uses the last one.
fn service_setting(name: &str) -> Option<String> {
    let unit = read_to_string(root().join("server/ngf-grasp.service")).unwrap();
    let section = unit.lines().skip_while(|line| *line != "[Service]").skip(1);
    let section = section.take_while(|line| !line.starts_with('['));
    let settings = section.filter_map(|line| line.split_once('='));
    settings.filter(|(key, _)| *key == name).last().map(|(_, value)| value.to_owned())
}

/// One client can exhaust the default soft limit, 1024, with idle connections.
#[test]
fn systemd_unit_permits_the_open_files_of_many_connections() {
    assert_eq!(service_setting("LimitNOFILE").as_deref(), Some("65536"));
}

/// Logs, weights and job files are private at any umask of the system.
#[test]
fn systemd_unit_keeps_new_files_private() {
    assert_eq!(service_setting("UMask").as_deref(), Some("0077"));
    assert_eq!(service_setting("StateDirectoryMode").as_deref(), Some("0700"));
}
