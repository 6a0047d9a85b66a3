-- Results of simulation runs: shares of rollouts, sums of crashes, means of the other metrics. $run selects one run.
-- Runs that were made beside others, by sim as references and by runs regress, come last.
-- run = ""
SELECT
    run,
    count(DISTINCT scenario_id) AS scenarios,
    count(*) AS rollouts,
    count(error) AS not_simulated,
    round(avg(success::INTEGER), 4) AS success,
    round(avg(out_of_road::INTEGER), 4) AS out_of_road,
    round(avg(timeout::INTEGER), 4) AS timeout,
    round(avg(crashed::INTEGER), 4) AS crashed,
    round(avg((at_fault_collisions > 0)::INTEGER), 4) AS at_fault,
    round(avg(off_road::INTEGER), 4) AS off_road,
    nullif(count(*) FILTER (error IS NULL AND off_road IS NULL), 0) AS off_road_unknown,
    round(avg((red_light_violations > 0)::INTEGER), 4) AS red_light,
    round(avg(nuplan_score), 4) AS nuplan_score,
    round(avg(route_completion), 4) AS route_completion,
    round(avg(progress_ratio), 4) AS progress_ratio,
    sum(collided_vehicles)::BIGINT AS collided_vehicles,
    sum(collided_humans)::BIGINT AS collided_humans,
    sum(collided_objects)::BIGINT AS collided_objects,
    round(avg(cost), 4) AS mean_cost,
    round(avg(mean_speed), 3) AS mean_speed,
    round(avg(is_comfortable::INTEGER), 4) AS is_comfortable,
    round(avg(is_time_to_collision_in_bound::INTEGER), 4) AS is_time_to_collision_in_bound,
    round(avg(driving_direction), 4) AS driving_direction,
    round(avg(speed_limit_compliance), 4) AS speed_limit_compliance,
    sum(red_light_violations)::BIGINT AS red_light_violations,
    round(avg((overlap_steps > 0)::INTEGER), 4) AS waymax_overlap,
    round(avg((offroad_steps > 0)::INTEGER), 4) AS waymax_offroad,
    round(avg(progression), 4) AS progression,
    sum(infeasible_steps)::BIGINT AS infeasible_steps,
    round(avg(average_displacement), 3) AS average_displacement,
    round(avg(final_displacement), 3) AS final_displacement
FROM results
WHERE $run IN ('', run)
GROUP BY run
ORDER BY run SIMILAR TO '(reference|regression)-.*', run;
