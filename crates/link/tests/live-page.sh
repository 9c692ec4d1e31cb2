#!/usr/bin/env bash
# Draws the live page of a running centre in headless Chromium, as wide as a phone, and asks that more stands on it than on the page without a centre.
# usage: live-page.sh http://HOST:PORT/ picture.png
set -eu
browser=$(command -v chromium || command -v chromium-browser || command -v google-chrome || true)
if [ -z "$browser" ]; then
    echo "skipped: no Chromium (apt-get install chromium)"
    exit 0
fi
empty=$(mktemp -d)
trap 'rm -rf "$empty"' EXIT
# Not in virtual time, which never passes while the stream of events is open.
draw() {
    "$browser" --headless --no-sandbox --disable-gpu --window-size=390,844 --timeout="$3" --screenshot="$2" "$1" 2>/dev/null
}
curl --silent --fail "$1" > "$empty/page.html"
draw "file://$empty/page.html" "$empty/page.png" 3000
without=$(stat -c %s "$empty/page.png")
# A busy machine draws late: it gets more and more time until something is seen.
for wait in 3000 10000 30000 60000; do
    draw "$1" "$2" "$wait"
    with=$(stat -c %s "$2")
    if [ "$with" -ge $((without * 3 / 2)) ]; then
        echo "ok: $with bytes with the centre, $without without"
        exit 0
    fi
done
echo "the page shows nothing: $with bytes with the centre, $without without"
exit 1
