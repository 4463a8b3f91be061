#!/usr/bin/env bash
# Runs once, as root, while Gradescope builds the image: installs what the jail needs, and the grader from its wheel.
# Wheels of its dependencies may be added to wheels/; with PIP_NO_INDEX=1 nothing is then downloaded.
set -euo pipefail
root="${AUTOGRADER_ROOT:-/autograder}"
source="$root/source"

# The interpreter must be 3.11 or newer.
newest() {
    local name
    for name in python3.14 python3.13 python3.12 python3.11 python3; do
        if command -v "$name" > /dev/null && "$name" -c 'import sys; sys.exit(sys.version_info < (3, 11))'; then
            echo "$name"
            return
        fi
    done
}

export DEBIAN_FRONTEND=noninteractive
apt-get update
apt-get install -y --no-install-recommends bubblewrap libseccomp2
python="$(newest)"
if [ -z "$python" ]; then
    apt-get install -y --no-install-recommends python3.11 python3.11-venv
    python=python3.11
elif ! "$python" -c 'import ensurepip' 2> /dev/null; then
    apt-get install -y --no-install-recommends "$("$python" -c 'import sys; print("python%d.%d-venv" % sys.version_info[:2])')"
fi

"$python" -m venv "$root/grader"
"$root/grader/bin/pip" install --quiet --find-links "$source/wheels" \
    --constraint "$source/constraints.txt" "$source"/wheels/*.whl

# A script in the jail runs as another user: the questions and the key are root's alone, the models everybody's.
chmod 600 "$source/key" "$source"/content/quizzes/*
chmod -R a+rX "$source/content/models"
