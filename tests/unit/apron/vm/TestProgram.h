// Test helpers: a builder for hand-written programs, a host that records calls, and bitwise float comparison.
#pragma once

#include <cmath>
#include <cstdint>
#include <cstdlib>
#include <cstring>
#include <map>
#include <random>
#include <ranges>
#include <string>
#include <utility>
#include <vector>

#include "apron/program/Program.h"
#include "apron/vm/Vm.h"
#include "tests/unit/common/ProgramSeeds.h"

namespace apron::vm::test {

using program::Opcode;
using program::Operand;
using program::OperandKind;

class TestProgram {
 public:
  TestProgram() {
    program.files = {"test.aps"};
    program.source_locations = {{0, 1, 1}};
  }
  Operand reg(std::uint32_t width, std::uint32_t height) {
    program.registers.push_back({name('R', program.registers.size()), width, height});
    return {OperandKind::kRegister, static_cast<std::uint32_t>(program.registers.size() - 1)};
  }
  Operand var(float initial = 0.0F) {
    program.variables.push_back({name('v', program.variables.size()), initial});
    return {OperandKind::kVariable, static_cast<std::uint32_t>(program.variables.size() - 1)};
  }
  Operand lit(float value) {
    program.literals.push_back(value);
    return {OperandKind::kLiteral, static_cast<std::uint32_t>(program.literals.size() - 1)};
  }
  Operand text(std::string value) {
    program.texts.push_back(std::move(value));
    return {OperandKind::kText, static_cast<std::uint32_t>(program.texts.size() - 1)};
  }
  static Operand label(std::size_t at) { return {OperandKind::kLabel, static_cast<std::uint32_t>(at)}; }
  std::size_t next_index() const { return program.code.size(); }

  // Appends an instruction on a source line of its own: instruction N is on line N + 1. Pass {} for no
  // destination.
  std::size_t add(Opcode op, Operand y = {}, Operand a = {}, Operand b = {}, Operand c = {},
                  bool masked = true) {
    program.source_locations.push_back({0, static_cast<std::uint32_t>(next_index() + 1), 1});
    program.code.push_back(
        {op, masked, static_cast<std::uint32_t>(program.source_locations.size() - 1), y, {a, b, c}});
    return next_index() - 1;
  }
  program::Program finish() {
    add(Opcode::kEnd);
    return program;
  }

  program::Program program;

 private:
  static std::string name(char kind, std::size_t number) {
    return std::string(1, kind).append(std::to_string(number));
  }
};

struct FakeHost : Host {
  std::string console;
  std::map<std::string, std::vector<float>> sensors;  // row-major, one value per cell of the register
  std::map<std::string, std::vector<float>> actuators;
  std::map<std::string, float> parameters;
  HostStatus step_status = HostStatus::kOk;
  int step_count = 0;
  std::string last_message;

  std::string message() const override { return last_message; }
  void print(std::string_view text) override { console += text; }
  std::optional<float> parameter(std::string_view name) override {
    const auto found = parameters.find(std::string(name));
    return found == parameters.end() ? std::nullopt : std::optional<float>(found->second);
  }
  HostStatus open_array(std::string_view name, Plane to) override { return sense(name, to); }
  HostStatus save_array(std::string_view name, ConstPlane from) override { return actuate(name, from); }
  HostStatus open_image(std::string_view name, Plane to) override { return sense(name, to); }
  HostStatus save_image(std::string_view name, ConstPlane from) override { return actuate(name, from); }
  HostStatus sense(std::string_view channel, Plane to) override {
    const auto found = sensors.find(std::string(channel));
    if (found == sensors.end() || found->second.size() != to.cell_count()) {
      last_message = "no channel " + std::string(channel);
      return HostStatus::kRefused;
    }
    for (std::uint32_t y = 0; y < to.height; ++y)
      for (std::uint32_t x = 0; x < to.width; ++x) to.row(y)[x] = found->second[y * to.width + x];
    return HostStatus::kOk;
  }
  HostStatus actuate(std::string_view channel, ConstPlane from) override {
    std::vector<float>& frame = actuators[std::string(channel)];
    frame.clear();
    for (std::uint32_t y = 0; y < from.height; ++y)
      frame.insert(frame.end(), from.row(y), from.row(y) + from.width);
    return HostStatus::kOk;
  }
  HostStatus actuate(std::string_view channel, float value) override {
    actuators[std::string(channel)] = {value};
    return HostStatus::kOk;
  }
  HostStatus step() override {
    ++step_count;
    return step_status;
  }
  std::optional<double> time_s() const override { return 0.5 * step_count; }
  std::optional<double> dt_s() const override { return 0.5; }
  std::optional<double> tick() const override { return step_count; }
  bool has(std::string_view channel) const override { return sensors.count(std::string(channel)) != 0; }
};

// Bitwise equality, except that any NaN equals any NaN.
inline bool bits_equal(float a, float b) {
  if (std::isnan(a) || std::isnan(b)) return std::isnan(a) && std::isnan(b);
  return std::memcmp(&a, &b, sizeof a) == 0;
}

using Cells = std::vector<float>;  // row-major

inline Cells read_cells(const Plane& plane) {
  Cells cells;
  for (std::uint32_t y = 0; y < plane.height; ++y)
    cells.insert(cells.end(), plane.row(y), plane.row(y) + plane.width);
  return cells;
}
inline void write_cells(const Plane& plane, const Cells& cells) {
  for (std::uint32_t y = 0; y < plane.height; ++y)
    for (std::uint32_t x = 0; x < plane.width; ++x) plane.row(y)[x] = cells[y * plane.width + x];
}

// Values that distinguish rounding and comparison rules: small integers, halves, both zeros, infinities, NaN,
// denormals and large numbers.
inline Cells random_cells(std::size_t n, std::mt19937& rng) {
  static const float kSpecial[] = {0.0F,  -0.0F, 1.0F,   -1.0F,    0.5F,      -0.5F, 1.5F,       2.5F,
                                   -2.5F, 3.0F,  1e-40F, INFINITY, -INFINITY, NAN,   8388609.0F, 0.49999997F};
  std::uniform_int_distribution<int> kind(0, 2);
  std::uniform_int_distribution<std::size_t> special(0, std::size(kSpecial) - 1);
  std::uniform_real_distribution<float> real(-4.0F, 4.0F);
  Cells cells(n);
  for (float& c : cells) c = kind(rng) == 0 ? kSpecial[special(rng)] : real(rng);
  return cells;
}
inline Cells random_mask(std::size_t n, std::mt19937& rng) {
  std::bernoulli_distribution on(0.5);
  Cells cells(n);
  for (float& c : cells) c = on(rng) ? (on(rng) ? 1.0F : -0.25F) : 0.0F;
  return cells;
}

struct Size {
  std::uint32_t width, height;
};
inline constexpr Size kSizes[] = {{1, 1}, {3, 5}, {17, 33}, {64, 64}, {100, 7}, {16, 2}, {1, 40}};

}  // namespace apron::vm::test
