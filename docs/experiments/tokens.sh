#!/bin/sh
# Trains the models of tokens of docs/guides/traffic.md: tokens.sh LAKE CHAIN [COMMAND], for the chains 0, 1 and part.
# Written before the first of these runs, with 20 epochs instead of 8: an epoch took 60 s on the graphics card beside two
# other trainings, so that was changed after the first epoch, before any model was scored. LAKE has the databases dev (three places of INTERACTION; for 0 and 1, which
# are seeds) or two (without DR_USA_Intersection_MA) and third_place (a third of that place, on which part is judged).
# Each chain is behaviour cloning, and from there on four epochs in closed loop, or four more of cloning.
set -eu
lake=$1 chain=$2 run=${3:-scenarionet}
case $chain in
    part) data=two seed=0 test="--test third_place" ;;
    *) data=dev seed=$chain test="" ;;
esac
learn() {
    $run traffic learn "$lake" $data --kind tokens --seed $seed $test -p batch_size=16 --name "$@"
}
learn "clone_$chain" -p epochs=8
learn "tuned_$chain" --start "clone_$chain" -p epochs=4 -p rate=1e-4 -p choices=32 &
learn "longer_$chain" --start "clone_$chain" -p epochs=4 -p rate=1e-4 &
if [ "$chain" = part ]; then  # closed loop without putting back on the recording who is lost
    learn "lost_$chain" --start "clone_$chain" -p epochs=4 -p rate=1e-4 -p choices=32 -p lost=1000 &
fi
wait
