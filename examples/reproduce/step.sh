#!/usr/bin/env bash
# One step of `make reproduce`, `make pod` and `make sea`: runs a scenario and prints a line with the time it took.
#
#   examples/reproduce/step.sh run|compare FOLDER NAME CODE
#
# for configs/FOLDER/NAME.yaml, which has to end with that exit code. What podusv says is kept in
# results/FOLDER.log, the result in results/runs/FOLDER/NAME. Of it, the files that results/FOLDER/NAME has are
# replaced there.
set -uo pipefail
verb=$1 folder=$2 name=$3 wanted=$4
kept=results/$folder/$name made=results/runs/$folder/$name log=results/$folder.log

printf '  %-26s' "$name"
SECONDS=0
echo "== $name" >>"$log"
"${PODUSV:-podusv}" "$verb" "configs/$folder/$name.yaml" --figure all --out "$made" --force -q >>"$log" 2>&1
code=$?
if test "$code" -ne "$wanted"; then
    echo "exit code $code in place of $wanted, after $SECONDS s; from $log:"
    tail -n 5 "$log"
    exit 1
fi
if test -d "$kept"; then
    (cd "$kept" && find . -type f) | while read -r file; do
        test ! -e "$made/$file" || cp "$made/$file" "$kept/$file" || exit 1
    done || exit 1
fi
case $code in
    0) how="done" ;;
    3) how="done, some runs diverged as expected" ;;
    4) how="diverged as expected" ;;
esac
printf '%4d s  %s\n' "$SECONDS" "$how"
