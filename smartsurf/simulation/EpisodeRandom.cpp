#include "smartsurf/simulation/EpisodeRandom.h"

#include <string>

#include "smartsurf/script/Random.h"

namespace smartsurf::simulation {

std::uint64_t next_seed(std::uint64_t seed) { return script::Random::stream(seed, "episode").next() >> 33; }

void draw_uniform(std::uint64_t seed, std::string_view purpose, std::span<double> numbers) {
  script::Random random = script::Random::stream(seed, "task " + std::string(purpose));
  for (double& number : numbers) number = random.uniform_unit();
}

}  // namespace smartsurf::simulation
