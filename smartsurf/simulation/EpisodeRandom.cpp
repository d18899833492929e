#include "smartsurf/simulation/EpisodeRandom.h"

#include <algorithm>
#include <cstdint>
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
  // Larger doubles may be no integers of 64 bits; no parameter is so large.
  const auto whole = [](double number) {
    return static_cast<std::int64_t>(std::clamp(number, -0x1p53, 0x1p53));
  };
  for (std::size_t i = 0; i < numbers.size(); ++i)
    numbers[i] = is_whole ? static_cast<double>(random.uniform_integer(whole(low[i]), whole(high[i])))
                          : random.uniform(low[i], high[i]);
}

}  // namespace smartsurf::simulation
