"""Checks the metrics of a server with the parser of Prometheus' Python client, and with promtool if it is installed.

Run as `python metrics.py URL`: URL is the address of a server.
"""

import shutil
import subprocess
import sys
import urllib.request

from prometheus_client.openmetrics.parser import text_string_to_metric_families as parse_openmetrics
from prometheus_client.parser import text_string_to_metric_families as parse_text


def fetch(url: str, accept: str) -> tuple[str, str]:
    request = urllib.request.Request(f"{url}/metrics", headers={"Accept": accept})
    with urllib.request.urlopen(request) as response:
        return response.headers["Content-Type"], response.read().decode()


def main() -> None:
    # The first request is counted in the second response.
    for accept in ("text/plain", "application/openmetrics-text", "text/plain"):
        content_type, text = fetch(sys.argv[1], accept)
        is_openmetrics = content_type.startswith("application/openmetrics-text")
        families = list((parse_openmetrics if is_openmetrics else parse_text)(text))
        samples = [sample for family in families for sample in family.samples]
        assert len(families) > 3 and samples, f"{len(families)} families in {content_type}"
        # promtool reads the text format, not OpenMetrics.
        if shutil.which("promtool") and not is_openmetrics:
            subprocess.run(["promtool", "check", "metrics"], input=text, text=True, check=True)
        print(f"{content_type}: {len(families)} metrics, {len(samples)} samples")


if __name__ == "__main__":
    main()
