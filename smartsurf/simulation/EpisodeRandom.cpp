#include "smartsurf/simulation/EpisodeRandom.h"

#include <string>

#include "smartsurf/script/Random.h"

namespace smartsurf::simulation {

std::uint64_t next_seed(std::uint64_t seed) { return script::Random::stream(seed, "episode").next() >> 11; }

void draw_uniform(std::uint64_t seed, std::string_view purpose, std::span<double> numbers) {
  script::Random random = script::Random::stream(seed, "task " + std::string(purpose));
  for (double& number : numbers) number = random.uniform_unit();
}

void draw_parameter(std::uint64_t seed, std::string_view name, bool is_whole, std::span<const double> low,
                    std::span<const double> high, std::span<double> numbers) {
  script::Random random = script::Random::stream(seed, "randomise " + std::string(name));
  for (std::size_t i = 0; i < numbers.size(); ++i)
    numbers[i] = is_whole ? static_cast<double>(random.uniform_integer(static_cast<std::int64_t>(low[i]),
                                                                       static_cast<std::int64_t>(high[i])))
                          : random.uniform(low[i], high[i]);
}

}  // namespace smartsurf::simulation
