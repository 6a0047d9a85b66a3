-- Results of simulation runs: ratios of scenarios, sums of crashes, means of the other metrics. $run selects one run.
-- run = ""
SELECT
    run,
    count(*) AS scenarios,
    count(error) AS not_simulated,
    round(avg(success::INTEGER), 4) AS success,
    round(avg(out_of_road::INTEGER), 4) AS out_of_road,
    round(avg(timeout::INTEGER), 4) AS timeout,
    round(avg(route_completion), 4) AS route_completion,
    sum(collided_vehicles)::BIGINT AS collided_vehicles,
    sum(collided_humans)::BIGINT AS collided_humans,
    sum(collided_objects)::BIGINT AS collided_objects,
    round(avg(cost), 4) AS mean_cost,
    round(avg(mean_speed), 3) AS mean_speed,
    round(avg(is_comfortable::INTEGER), 4) AS comfortable,
    round(avg(is_time_to_collision_long::INTEGER), 4) AS time_to_collision_long,
    round(avg((off_road_time > 0)::INTEGER), 4) AS off_road,
    round(avg(driving_direction), 4) AS driving_direction,
    sum(red_light_violations)::BIGINT AS red_light_violations,
    sum(infeasible_steps)::BIGINT AS infeasible_steps,
    round(avg(average_displacement), 3) AS average_displacement,
    round(avg(final_displacement), 3) AS final_displacement
FROM results
WHERE $run IN ('', run)
GROUP BY run
ORDER BY run;
