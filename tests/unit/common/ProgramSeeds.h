// The seeds of random programs and cells, which scripts/check-language sets: of programs as many as `usual`
// from 0 on, or APRON_PROGRAM_SEEDS from APRON_PROGRAM_FIRST on.
#pragma once

#include <gtest/gtest.h>

#include <cstdlib>
#include <ranges>
#include <string>

inline unsigned number_of_environment(const char* name, unsigned otherwise) {
  const char* const text = std::getenv(name);
  return text != nullptr ? static_cast<unsigned>(std::strtoul(text, nullptr, 10)) : otherwise;
}
inline unsigned first_program_seed() { return number_of_environment("APRON_PROGRAM_FIRST", 0); }
inline auto program_seeds(unsigned usual) {
  const unsigned first = first_program_seed();
  return std::views::iota(first, first + number_of_environment("APRON_PROGRAM_SEEDS", usual));
}

// Tells scripts/check-language how many programs or values a test compared.
inline void count_cases(std::size_t cases) { testing::Test::RecordProperty("cases", std::to_string(cases)); }
