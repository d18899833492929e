// Quantiles of many measurements in constant memory: a histogram of equal ratios.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <string>

namespace hardware {

// Values from 0.1 to 1e9, to 2 %; smaller and larger ones count as these.
class Quantiles {
 public:
  void add(double value) {
    const double bin = std::log(std::max(value, 0.1) / 0.1) / kLogRatio;
    ++bins_[static_cast<std::size_t>(std::clamp(bin, 0.0, static_cast<double>(bins_.size() - 1)))];
    ++count_;
    most_ = std::max(most_, value);
  }
  double at(double share) const {
    const auto rank = static_cast<std::uint64_t>(share * static_cast<double>(count_));
    std::uint64_t below = 0;
    for (std::size_t i = 0; i < bins_.size(); ++i)
      if ((below += bins_[i]) > rank)
        return std::min(0.1 * std::exp((static_cast<double>(i) + 0.5) * kLogRatio), most_);
    return most_;
  }
  double most() const { return most_; }
  std::uint64_t count() const { return count_; }
  std::string text() const {
    const auto n = [](double v) { return std::to_string(static_cast<long long>(std::llround(v))); };
    return "median " + n(at(0.5)) + " p99 " + n(at(0.99)) + " max " + n(most_);
  }

 private:
  static constexpr double kLogRatio = 0.02;
  std::array<std::uint32_t, 1152> bins_{};
  std::uint64_t count_ = 0;
  double most_ = 0;
};

}  // namespace hardware
