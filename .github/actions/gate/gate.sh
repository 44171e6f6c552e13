#!/usr/bin/env bash
# SPDX-License-Identifier: Apache-2.0
# Gate a method in continuous integration: the steps of action.yml, for any other service as well.
#
#   gate.sh key        print key=NAME: what a cache of GATE_CACHE and ~/.cache/graycard is good for
#   gate.sh install    make an environment with graycard, if the cache has none, and install your code into it
#   gate.sh bench      render the scenes that the cache lacks, fit the methods and score them
#   gate.sh gate       compare with the baseline of the branch; 1: worse, 2: scores are missing
#
# Variables (docs/how-to/gate-your-ci.md):
#   GATE_METHOD, GATE_PREDICTIONS, GATE_SUITE, GATE_TRACKS, GATE_BASELINE, GATE_BRANCH, GATE_TOLERANCE, GATE_INSTALL,
#   GATE_TORCH_INDEX, GATE_HISTORY, and GATE_CACHE (~/.cache/graycard-gate), GATE_RUN (graycard-gate).
set -euo pipefail

home=$(cd "$(dirname "${BASH_SOURCE[0]}")/../../.." && pwd) # graycard's own files
cache=${GATE_CACHE:-$HOME/.cache/graycard-gate}
run=${GATE_RUN:-graycard-gate}
suite=${GATE_SUITE:-ci}
python=${PYTHON:-python3}
history=(gate-history.json README.md) # files of the branch GATE_HISTORY

# A cache is good for one state of graycard, one Python and one suite.
key() {
  local files=(src benchmarks eval methods reports synth pyproject.toml constraints.txt)
  [ -f "$suite" ] && local own=("$PWD/$suite") || local own=()
  local digest
  digest=$(cd "$home" && find -L "${files[@]}" "${own[@]}" -type f \( -name '*.py' -o -name '*.toml' -o -name '*.txt' \) -print0 |
    LC_ALL=C sort -z | xargs -0 sha256sum | sha256sum | cut -c1-16)
  echo "key=graycard-$(uname -s)-$(uname -m)-$("$python" -c 'import sys; print("%d.%d" % sys.version_info[:2])')-$(basename "$suite" .toml)-$digest"
}

install() {
  local env=$cache/env state
  state=$(key)
  if [ "$(cat "$env/whole" 2>/dev/null)" != "$state" ]; then
    rm -rf "$env"
    "$python" -m venv "$env"
    local pip=("$env/bin/pip" install --quiet --disable-pip-version-check --constraint "$home/constraints.txt")
    # By a variable: an index that asks for a password has it in its address.
    ([ -z "${GATE_TORCH_INDEX:-}" ] || export PIP_INDEX_URL=$GATE_TORCH_INDEX && "${pip[@]}" torch)
    # From a copy: building in place would leave files in a checkout that others use.
    local copy
    copy=$(mktemp -d)
    cp -R "$home"/{LICENSE,README.md,pyproject.toml,src,benchmarks,eval,methods,reports,synth} "$copy"
    "${pip[@]}" "$copy"
    rm -rf "$copy"
    echo "$state" >"$env/whole"
  fi
  # shellcheck disable=SC2086 # several arguments are meant
  [ -z "${GATE_INSTALL:-}" ] || "$env/bin/pip" install --quiet --disable-pip-version-check $GATE_INSTALL
  "$env/bin/graycard" --version
}

bench() {
  local options=(--dataset "$cache/scenes" --out "$run")
  # shellcheck disable=SC2206 # several words are meant
  [ -z "${GATE_METHOD:-}" ] || options+=(--methods $GATE_METHOD)
  # shellcheck disable=SC2206
  [ -z "${GATE_PREDICTIONS:-}" ] || options+=(--predictions $GATE_PREDICTIONS)
  # shellcheck disable=SC2206
  [ -z "${GATE_TRACKS:-}" ] || options+=(--tracks $GATE_TRACKS)
  local code=0
  "$cache/env/bin/graycard" bench "$suite" "${options[@]}" || code=$?
  [ "$code" -le 1 ] || return "$code"
  echo "$code" >"$run/bench.code" # a fit that failed has no scores: the gate names it
}

# Fetch a branch, and no tag of its name. A whole clone stays whole: `--depth` would cut its history.
fetch() {
  local depth=()
  [ "$(git rev-parse --is-shallow-repository)" = false ] || depth=(--depth=1)
  git fetch --quiet "${depth[@]}" origin "refs/heads/$1"
}

# The baseline is that of the branch, not of the change: who makes it worse cannot lower the bar in one go.
gate() {
  local graycard=$cache/env/bin/graycard baseline=${GATE_BASELINE:-graycard-baseline.json} branch=${GATE_BRANCH:-main}
  local expected=$run/expected.json summary=${GITHUB_STEP_SUMMARY:-$run/summary.md}
  [ -z "${GITHUB_OUTPUT:-}" ] || echo "run=$run" >>"$GITHUB_OUTPUT"
  "$graycard" gate "$run" --baseline "$run/baseline.json" --write || true # nothing, where all fits failed
  rm -f "$expected"
  if ! fetch "$branch"; then # nothing may pass
    echo "gate: expected a branch $branch on the remote origin that can be fetched, got none." \
      "Name it by GATE_BRANCH, or add the remote: git remote add origin URL" >&2
    return 2
  fi
  if git show "FETCH_HEAD:$baseline" >"$expected.partial" 2>/dev/null; then
    mv "$expected.partial" "$expected"
  else
    rm -f "$expected.partial"
    local advice="no $baseline on $branch yet: commit $run/baseline.json of this run as that"
    if [ -n "${GITHUB_ACTIONS:-}" ]; then echo "::notice title=graycard gate::$advice"; else echo "gate: passed: $advice"; fi
    printf '### graycard gate: nothing to compare with\n\nThere is no `%s` on `%s` yet. Commit `baseline.json` of this run under that name.\n' \
      "$baseline" "$branch" >>"$summary"
    return "$(cat "$run/bench.code")"
  fi
  local options=(--baseline "$expected" --tolerance "${GATE_TOLERANCE:-1}")
  "$graycard" report "$run" --summary md "${options[@]}" >>"$summary"
  "$graycard" report "$run" --summary junit "${options[@]}" --out "$run/gate.xml"
  local told=(--json "$run/gate.json") code=0
  [ -z "${GITHUB_ACTIONS:-}" ] || told+=(--annotate)
  "$graycard" gate "$run" "${options[@]}" "${told[@]}" || code=$?
  if [ -n "${GATE_HISTORY:-}" ] && [ "${GITHUB_REF_NAME:-$branch}" = "$branch" ]; then
    keep_history "$graycard" "${options[@]}"
  fi
  return "$code"
}

# Add the commit to the history, on a branch of its own that shares nothing with your code. Whatever comes of it, the
# verdict stands. The checkout itself fetches and pushes: it knows its remote and its token. A token in git's
# configuration, as actions/checkout keeps it, is in no list of processes. One in the address of the remote is: git
# hands that address to programs of its own.
keep_history() {
  local said
  said=$(add_to_history "$@" 2>&1) && return
  said=$(add_to_history "$@" 2>&1) && return # another run may have pushed meanwhile
  echo "gate: the history was not pushed, and the verdict stands. $said" >&2
}

# Write the history with the commit into $run/history, and push it on top of what the remote has. This is a process of
# its own, whose temporary files go with it. `set -e` ends nothing here, as a condition calls it.
add_to_history() (
  place=$run/history
  parent=()
  scratch=$(mktemp -d) || exit
  trap 'rm -rf "$scratch"' EXIT
  rm -rf "$place" && mkdir -p "$place" && fetch_history || exit
  # The program judges once more, and says the same. It names the history only if it has added to it.
  "$1" gate "$run" "${@:2}" --history "$place" --commit "$(git rev-parse HEAD)" >"$scratch/told" || true
  if ! grep -q '^history: ' "$scratch/told"; then
    echo "graycard gate added nothing to the branch $GATE_HISTORY" >&2
    exit 1
  fi
  push_history
)

# Fetch the history into $place, where there is one, and name its commit in `parent`.
fetch_history() {
  local heads name
  heads=$(git ls-remote --heads origin "refs/heads/$GATE_HISTORY") || return
  [ -n "$heads" ] || return 0
  fetch "$GATE_HISTORY" || return
  parent=(-p "$(git rev-parse FETCH_HEAD)")
  for name in "${history[@]}"; do
    if git cat-file -e "FETCH_HEAD:$name" 2>/dev/null; then
      git cat-file blob "FETCH_HEAD:$name" >"$place/$name" || return
    fi
  done
}

# Commit $place on top of `parent` without touching the working tree, and push it. No filter changes the files.
push_history() {
  local name blob tree commit
  local -x GIT_INDEX_FILE=$scratch/index
  [ "${#parent[@]}" = 0 ] || git read-tree "${parent[1]}" || return
  for name in "${history[@]}"; do
    blob=$(git hash-object -w --no-filters "$place/$name") || return
    git update-index --add --cacheinfo "100644,$blob,$name" || return
  done
  tree=$(git write-tree) || return
  commit=$(git -c user.name=graycard -c user.email=graycard@localhost \
    commit-tree "${parent[@]}" -m "Record $(git rev-parse --short HEAD)" "$tree") || return
  git push --quiet --no-verify origin "$commit:refs/heads/$GATE_HISTORY" 2>"$scratch/told" && return
  cat "$scratch/told" >&2
  if grep -qiE 'error: 403|denied|not allowed' "$scratch/told"; then
    echo "A push takes the right to write (on GitHub, permissions: contents: write)" >&2
  fi
  return 1
}

case ${1:-} in
  key | install | bench | gate) "$1" ;;
  *)
    sed -n '3,14s/^# \{0,1\}//p' "${BASH_SOURCE[0]}" >&2
    exit 2
    ;;
esac
