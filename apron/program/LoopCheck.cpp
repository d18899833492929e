#include "apron/program/LoopCheck.h"

#include <fmt/format.h>

#include <cmath>
#include <string_view>
#include <utility>

namespace apron::program {
namespace {

std::string number_text(double number) {
  constexpr double kExact = 1e16;
  if (std::isnan(number)) return "NaN";
  if (number == std::trunc(number) && std::fabs(number) < kExact) return fmt::format("{:.0f}", number);
  return fmt::format("{}", static_cast<float>(number));
}

}  // namespace

std::string check_for(double from, double to, double step) {
  if (step == 0.0) return "the step of a 'for' cannot be zero";
  for (const auto& [number, role] :
       {std::pair<double, std::string_view>{from, "first value"}, {to, "last value"}, {step, "step"}})
    if (!(std::fabs(number) <= kMaxLoopCount))
      return fmt::format("'for' counts from -{0:.0f} to {0:.0f} at most, and its {1} is {2}", kMaxLoopCount,
                         role, number_text(number));
  return {};
}

std::string check_repeat(double rounds) {
  if (std::isnan(rounds)) return "'repeat' takes a number of rounds, not NaN";
  if (rounds > kMaxLoopCount)
    return fmt::format("'repeat' counts up to {:.0f} at most, not to {}", kMaxLoopCount, number_text(rounds));
  return {};
}

}  // namespace apron::program
