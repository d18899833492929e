// Random numbers of episodes outside the script, each a function of the episode's seed and a purpose.
#pragma once

#include <cstdint>
#include <span>
#include <string_view>

namespace smartsurf::simulation {

// The seed of the episode that follows one with that seed. 53 bits: exact in any language, and so many that
// the chains of a billion episodes hardly meet. Worlds whose chains have met repeat each other for ever.
std::uint64_t next_seed(std::uint64_t seed);

// Uniform in [0, 1). Streams of different seeds or purposes are independent of each other and of the
// script's.
void draw_uniform(std::uint64_t seed, std::string_view purpose, std::span<double> numbers);

// The numbers that a nuisance or a randomised parameter has in an episode: each uniform in [low, high), or,
// if whole, in [low, high]. The three have one size.
void draw_parameter(std::uint64_t seed, std::string_view name, bool is_whole, std::span<const double> low,
                    std::span<const double> high, std::span<double> numbers);

}  // namespace smartsurf::simulation
