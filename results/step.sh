#!/usr/bin/env bash
# One step of `make reproduce`, `make pod` and `make sea`: runs a scenario and prints a line with the time it took.
#
#   results/step.sh run|compare FOLDER NAME CODE
#
# for configs/FOLDER/NAME.yaml, which has to end with that exit code. What podusv says is kept in
# results/FOLDER.log. The result goes to results/FOLDER/NAME; where only the committed files are there, it is
# made beside them and laid over them when it is whole.
set -uo pipefail
verb=$1 folder=$2 name=$3 wanted=$4
place=results/$folder/$name made=results/$folder/$name log=results/$folder.log
test -e "$place/manifest.json" || made=results/.new/$folder/$name

printf '  %-26s' "$name"
SECONDS=0
echo "== $name" >>"$log"
"${PODUSV:-podusv}" "$verb" "configs/$folder/$name.yaml" --out "$made" --force -q >>"$log" 2>&1
code=$?
if test "$code" -ne "$wanted"; then
    echo "exit code $code in place of $wanted, after $SECONDS s; from $log:"
    tail -n 5 "$log"
    exit 1
fi
if test "$made" != "$place"; then
    mkdir -p "$place" && cp -R "$made/." "$place/" && rm -rf "$made" || exit 1
fi
case $code in
    0) how="done" ;;
    3) how="done, some runs diverged as expected" ;;
    4) how="diverged as expected" ;;
esac
printf '%4d s  %s\n' "$SECONDS" "$how"
