#!/usr/bin/env bash
# Runs the C surface of the examples with each controller given; both sides must end well.
#   examples_test.sh SURFACE CONTROLLER…
set -euo pipefail
surface=$1
shift
for controller in "$@"; do
  name=examples-$$-$(basename "$controller")
  "$surface" "$name" &
  peer=$!
  "$controller" "$name" || { echo "$controller: status $?"; kill "$peer"; exit 1; }
  wait "$peer" || { echo "$surface with $controller: status $?"; exit 1; }
  [ ! -e "/dev/shm/smartsurf.$name" ] || { echo "$name was left behind"; exit 1; }
done
