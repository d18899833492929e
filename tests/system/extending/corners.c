/* Calls each function of smartsurf.h, also with arguments that it must refuse. */
#include <smartsurf.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

static void expect(int fact, const char* text, int line) {
  if (fact) return;
  fprintf(stderr, "corners.c:%d: %s; last error: %s\n", line, text, smartsurf_error());
  exit(1);
}
#define EXPECT(fact) expect(fact, #fact, __LINE__)
#define EXPECT_REFUSED(call, why) EXPECT((call) == SMARTSURF_INVALID && strcmp(smartsurf_error(), why) == 0)

static smartsurf_environment* make(const char* text, const char* assignment) {
  const uint64_t seed = 3;
  const smartsurf_options options = {.size = sizeof options,
                                     .file = "corners.lua",
                                     .text = text,
                                     .set = &assignment,
                                     .set_count = 1,
                                     .seed = &seed,
                                     .threads = 2};
  smartsurf_environment* made = NULL;
  EXPECT(smartsurf_create(&options, &made) == SMARTSURF_OK);
  return made;
}

int main(void) {
  const char* text =
      "local n = option('n', 4)\nsurface { rows = n, columns = 6, sensors = { colour {} },\n"
      "  mask = function(r, c) return r + c > 2 end }\n"
      "sphere { radius = 1, position = {2, 2, 3} }\nreward(function(t) return 2 end)\nepisode { seconds = "
      "0.1 }\n";
  EXPECT(strcmp(smartsurf_version(), "") != 0);
  smartsurf_environment* table = make(text, "n=5");
  smartsurf_state state = {.size = sizeof state};
  EXPECT(smartsurf_get_state(table, &state) == SMARTSURF_OK);
  EXPECT(state.rows == 5 && state.columns == 6 && state.seed == 3 && state.tick == 0 &&
         state.object_count == 1);
  EXPECT(state.id[0] == 0 && state.position[2] == 3.0F && state.orientation[3] == 1.0F &&
         state.velocity[2] == 0.0F);

  EXPECT(smartsurf_channel_count(table, SMARTSURF_SENSORS) == 2 &&
         smartsurf_channel_count(table, SMARTSURF_ACTUATORS) == 1);
  smartsurf_channel channel = {.size = sizeof channel};
  EXPECT(smartsurf_get_channel(table, SMARTSURF_SENSORS, 0, &channel) == SMARTSURF_OK);
  EXPECT(strcmp(channel.name, "colour") == 0 && channel.components == 3);
  EXPECT(smartsurf_get_channel(table, SMARTSURF_SENSORS, 1, &channel) == SMARTSURF_OK);
  EXPECT(strcmp(channel.name, "occupancy") == 0 && channel.values[0] == 0.0F && channel.values[1] == 1.0F);
  EXPECT(smartsurf_get_channel(table, SMARTSURF_ACTUATORS, 1, &channel) == SMARTSURF_INVALID);
  EXPECT(strcmp(smartsurf_error(), "index = 1: there are 1 channels") == 0);

  float targets[5 * 6] = {0};
  targets[7] = 1e9F;
  EXPECT(smartsurf_set_targets(table, 0, targets, 29) == SMARTSURF_INVALID);
  EXPECT(smartsurf_set_targets(table, 1, targets, 30) == SMARTSURF_INVALID);
  EXPECT(smartsurf_set_targets(table, 0, targets, 30) == SMARTSURF_OK);
  EXPECT(smartsurf_get_channel(table, SMARTSURF_ACTUATORS, 0, &channel) == SMARTSURF_OK);
  EXPECT(strcmp(channel.name, "height") == 0 && (double)channel.values[7] == channel.maximum);

  smartsurf_result result = {.size = sizeof result};
  for (int tick = 0; tick < 6; ++tick) EXPECT(smartsurf_step(table, &result) == SMARTSURF_OK);
  EXPECT(result.reward == 2.0 && result.truncated && !result.terminated && !result.success);

  const void* bytes;
  size_t count;
  EXPECT(smartsurf_save(table, &bytes, &count) == SMARTSURF_OK);
  smartsurf_environment* other = make(text, "n=5");
  EXPECT(smartsurf_restore(other, bytes, count) == SMARTSURF_OK);
  smartsurf_state there = {.size = sizeof there};
  for (int tick = 0; tick < 6; ++tick)
    EXPECT(smartsurf_step(table, NULL) == SMARTSURF_OK && smartsurf_step(other, NULL) == SMARTSURF_OK);
  EXPECT(smartsurf_get_state(table, &state) == SMARTSURF_OK &&
         smartsurf_get_state(other, &there) == SMARTSURF_OK);
  EXPECT(state.hash == there.hash && state.tick == 12);
  EXPECT(smartsurf_restore(other, bytes, count - 1) == SMARTSURF_INVALID);
  EXPECT(strstr(smartsurf_error(), "the state is damaged") != NULL);
  smartsurf_environment* smaller = make(text, "n=4");
  EXPECT(smartsurf_restore(smaller, bytes, count) == SMARTSURF_INVALID);

  EXPECT(smartsurf_reset(table, 9) == SMARTSURF_OK && smartsurf_get_state(table, &state) == SMARTSURF_OK);
  EXPECT(state.seed == 9 && state.tick == 0 && state.position[2] == 3.0F);

  /* A caller of an earlier version: the members that it lacks are neither read nor written. */
  struct {
    size_t size;
    int rows, columns, guard;
  } early = {.size = sizeof(size_t) + 2 * sizeof(int), .guard = 77};
  EXPECT(smartsurf_get_state(table, (smartsurf_state*)(void*)&early) == SMARTSURF_OK);
  EXPECT(early.rows == 5 && early.columns == 6 && early.guard == 77);
  result.size = 0;
  EXPECT(smartsurf_step(table, &result) == SMARTSURF_INVALID);
  EXPECT(strcmp(smartsurf_error(), "result.size = 0: must be sizeof the struct") == 0);
  EXPECT(smartsurf_get_state(table, &state) == SMARTSURF_OK && state.tick == 0);
  state.size = 0;
  EXPECT(smartsurf_get_state(table, &state) == SMARTSURF_INVALID);
  EXPECT(strcmp(smartsurf_error(), "state.size = 0: must be sizeof the struct") == 0);

  /* After a failure every call fails until the reset. */
  smartsurf_environment* failing = make(
      "option('n', 4) surface { rows = 2, columns = 2 } reward(function(t, tick) assert(tick ~= 2, 'no') "
      "return 1 end)",
      "n=4");
  EXPECT(smartsurf_step(failing, NULL) == SMARTSURF_OK);
  for (int attempt = 0; attempt < 3; ++attempt) {
    EXPECT(smartsurf_step(failing, NULL) == SMARTSURF_INVALID);
    EXPECT(strstr(smartsurf_error(), attempt == 0 ? "no" : "the episode has failed: reset it") != NULL);
    EXPECT(smartsurf_save(failing, &bytes, &count) == SMARTSURF_INVALID);
  }
  EXPECT(smartsurf_reset(failing, 1) == SMARTSURF_OK && smartsurf_step(failing, NULL) == SMARTSURF_OK);
  smartsurf_destroy(failing);

  smartsurf_environment* refused = NULL;
  const smartsurf_options coloured = {
      .size = sizeof coloured, .file = "corners.lua", .text = "error('\\u{9b}31m\\u{202e}')"};
  EXPECT_REFUSED(smartsurf_create(&coloured, &refused), "corners.lua:1: ?31m?");

  EXPECT_REFUSED(smartsurf_step(NULL, NULL), "environment: is null");
  EXPECT_REFUSED(smartsurf_reset(NULL, 1), "environment: is null");
  EXPECT_REFUSED(smartsurf_save(NULL, &bytes, &count), "environment: is null");
  EXPECT_REFUSED(smartsurf_save(table, NULL, &count), "bytes: is null");
  EXPECT_REFUSED(smartsurf_save(table, &bytes, NULL), "count: is null");
  EXPECT_REFUSED(smartsurf_restore(NULL, "", 1), "environment: is null");
  EXPECT_REFUSED(smartsurf_restore(table, NULL, 0), "bytes: is null");
  EXPECT_REFUSED(smartsurf_restore(table, NULL, 100), "bytes: is null");
  EXPECT_REFUSED(smartsurf_set_targets(NULL, 0, targets, 30), "environment: is null");
  EXPECT_REFUSED(smartsurf_set_targets(table, 0, NULL, 30), "targets: is null");
  EXPECT_REFUSED(smartsurf_get_state(NULL, &state), "environment: is null");
  EXPECT_REFUSED(smartsurf_get_state(table, NULL), "state: is null");
  EXPECT_REFUSED(smartsurf_get_channel(NULL, SMARTSURF_SENSORS, 0, &channel), "environment: is null");
  EXPECT_REFUSED(smartsurf_get_channel(table, SMARTSURF_SENSORS, 0, NULL), "channel: is null");
  EXPECT_REFUSED(smartsurf_get_channel(table, (smartsurf_direction)7, 0, &channel),
                 "direction = 7: must be SMARTSURF_SENSORS or SMARTSURF_ACTUATORS");
  EXPECT(smartsurf_channel_count(NULL, SMARTSURF_SENSORS) == 0 &&
         smartsurf_channel_count(table, (smartsurf_direction)7) == 0);
  EXPECT_REFUSED(smartsurf_load_extension(NULL), "path: is null");

  smartsurf_options options = {.size = sizeof options, .file = "none.lua"};
  EXPECT_REFUSED(smartsurf_create(&options, NULL), "environment: is null");
  smartsurf_environment* none = table;
  EXPECT(smartsurf_create(&options, &none) == SMARTSURF_INVALID && none == NULL);
  EXPECT(smartsurf_create(NULL, &none) == SMARTSURF_INVALID);
  const char* const set[] = {"n=4", NULL};
  options.set_count = 2;
  EXPECT(smartsurf_create(&options, &none) == SMARTSURF_INVALID);
  EXPECT(strcmp(smartsurf_error(), "options.set: is null") == 0);
  options.set = set;
  EXPECT(smartsurf_create(&options, &none) == SMARTSURF_INVALID);
  EXPECT(strcmp(smartsurf_error(), "options.set[1]: is null") == 0);
  EXPECT(smartsurf_load_extension("none.so") == SMARTSURF_INVALID);
  EXPECT(strcmp(smartsurf_error(), "none.so: cannot be read: No such file or directory") == 0);
  smartsurf_destroy(NULL);
  smartsurf_destroy(smaller);
  smartsurf_destroy(other);
  smartsurf_destroy(table);
  puts("done");
  return 0;
}
