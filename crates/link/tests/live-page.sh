#!/usr/bin/env bash
# Looks at the live page of a running centre in headless Chromium, as wide as a phone: draws it and asks that its table is filled.
# usage: live-page.sh http://HOST:PORT/ [picture.png]
set -eu
browser=$(command -v chromium || command -v chromium-browser || command -v google-chrome || true)
if [ -z "$browser" ]; then
    echo "skipped: no Chromium (apt-get install chromium)"
    exit 0
fi
# Not in virtual time, which never passes while the stream of events is open.
flags=(--headless --no-sandbox --disable-gpu --window-size=390,844 --timeout=3000)
if [ $# -gt 1 ]; then
    "$browser" "${flags[@]}" --screenshot="$2" "$1" 2>/dev/null
fi
page=$("$browser" "${flags[@]}" --dump-dom "$1" 2>/dev/null)
grep -q '<td class="last">' <<<"$page" || { echo "the page shows no sensor"; exit 1; }
grep -q 'bits/s' <<<"$page" || { echo "the page shows no rate"; exit 1; }
echo "ok: the page shows its sensors"
