// Steps of PufferDrive's environment without Python: MAP WORLDS STEPS, prints agent-steps per second of processor time.
#include <stdbool.h>
#define PI 3.14159265358979323846f
#include "drive_without_pictures.h"

int main(int count, char** words) {
    int worlds = atoi(words[2]), steps = atoi(words[3]);
    Drive* envs = calloc(worlds, sizeof(Drive));
    long agents = 0;
    for (int w = 0; w < worlds; w++) {
        Drive* env = &envs[w];
        env->map_name = words[1];
        env->reward_vehicle_collision = env->reward_vehicle_collision_post_respawn = -0.5f;
        env->reward_offroad_collision = -0.2f;
        env->reward_goal = 1.0f;
        env->reward_goal_post_respawn = 0.25f;
        env->spawn_immunity_timer = 50;
        env->goal_radius = 2.0f;
        env->policy_agents_per_env = -1;
        env->control_all_agents = 1;
        env->num_agents = MAX_AGENTS;
        allocate(env);
        c_reset(env);
        for (int a = 0; a < env->active_agent_count; a++) {  // neither gas nor steering
            ((int*)env->actions)[2 * a] = 3;
            ((int*)env->actions)[2 * a + 1] = 6;
        }
        agents += env->active_agent_count;
    }
    clock_t begin = clock();
    for (int k = 0; k < steps; k++)
        for (int w = 0; w < worlds; w++) c_step(&envs[w]);
    printf("%f\n", agents * (double)steps * CLOCKS_PER_SEC / (clock() - begin));
}
