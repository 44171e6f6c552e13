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

# A whole clone stays whole: `--depth` would cut its history. Without the branch nothing may pass.
fetch() {
  local depth=()
  [ "$(git rev-parse --is-shallow-repository)" = false ] || depth=(--depth=1)
  git fetch --quiet "${depth[@]}" origin "$1" && return
  echo "gate: expected a branch $1 on the remote origin that can be fetched, got none." \
    "Name it by GATE_BRANCH, or add the remote: git remote add origin URL" >&2
  return 1
}

# The baseline is that of the branch, not of the change: who makes it worse cannot lower the bar in one go.
gate() {
  local graycard=$cache/env/bin/graycard baseline=${GATE_BASELINE:-graycard-baseline.json} branch=${GATE_BRANCH:-main}
  local expected=$run/expected.json summary=${GITHUB_STEP_SUMMARY:-$run/summary.md}
  [ -z "${GITHUB_OUTPUT:-}" ] || echo "run=$run" >>"$GITHUB_OUTPUT"
  "$graycard" gate "$run" --baseline "$run/baseline.json" --write || true # nothing, where all fits failed
  rm -f "$expected"
  fetch "$branch" || return 2
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
  options+=(--json "$run/gate.json")
  [ -z "${GITHUB_ACTIONS:-}" ] || options+=(--annotate)
  local code=0
  if [ -n "${GATE_HISTORY:-}" ] && [ "${GITHUB_REF_NAME:-$branch}" = "$branch" ]; then
    with_history "$graycard" "${options[@]}" || code=$?
  else
    "$graycard" gate "$run" "${options[@]}" || code=$?
  fi
  return "$code"
}

# Add the commit to the history, on a branch of its own that shares nothing with your code. The checkout itself fetches
# and pushes: it knows its remote and its token, and neither is handed on where lists of processes would show it.
with_history() {
  local code=0
  record_history "$@" || code=$?
  if ! push_history; then # another run may have pushed meanwhile
    record_history "$@" >/dev/null || true
    push_history || echo "The history was not pushed: it needs the right to write (permissions: contents: write)" >&2
  fi
  return "$code"
}

# Judge the run, and write the history with it into $run/history; its parent commit is named beside it.
record_history() {
  local graycard=$1 place=$run/history name
  shift
  rm -rf "$place" "$run/history.parent"
  mkdir -p "$place"
  if [ -n "$(git ls-remote --heads origin "refs/heads/$GATE_HISTORY")" ]; then
    fetch "$GATE_HISTORY" || return 2
    git rev-parse FETCH_HEAD >"$run/history.parent"
    for name in "${history[@]}"; do
      git show "FETCH_HEAD:$name" >"$place/$name" 2>/dev/null || rm -f "$place/$name"
    done
  fi
  "$graycard" gate "$run" "$@" --history "$place" --commit "$(git rev-parse HEAD)"
}

# Commit $run/history on top of its parent without touching the working tree, and push it.
push_history() {
  local parent=() name blob tree commit
  local -x GIT_INDEX_FILE
  GIT_INDEX_FILE=$(mktemp -d)/index
  if [ -s "$run/history.parent" ]; then
    parent=(-p "$(cat "$run/history.parent")")
    git read-tree "${parent[1]}" || return
  fi
  for name in "${history[@]}"; do
    blob=$(git hash-object -w "$run/history/$name") && git update-index --add --cacheinfo "100644,$blob,$name" || return
  done
  tree=$(git write-tree) || return
  rm -rf "${GIT_INDEX_FILE%/index}"
  commit=$(git -c user.name=graycard -c user.email=graycard@localhost \
    commit-tree "${parent[@]}" -m "Record $(git rev-parse --short HEAD)" "$tree") || return
  git push --quiet --no-verify origin "$commit:refs/heads/$GATE_HISTORY"
}

case ${1:-} in
  key | install | bench | gate) "$1" ;;
  *)
    sed -n '3,14s/^# \{0,1\}//p' "${BASH_SOURCE[0]}" >&2
    exit 2
    ;;
esac
