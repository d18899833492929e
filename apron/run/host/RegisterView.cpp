#include "apron/run/host/RegisterView.h"

#include <fmt/format.h>

#include <algorithm>
#include <limits>

#include "common/error/UserError.h"
#include "common/process/SharedPlanes.h"

namespace apron::run {
namespace {

// Temporaries of the compiler are not the user's.
bool is_named(const program::Register& reg) { return !reg.name.empty() && reg.name.front() != '$'; }

std::vector<std::string> split_names(const std::string& text) {
  std::vector<std::string> names;
  for (std::size_t begin = 0; begin <= text.size();) {
    const std::size_t end = std::min(text.find(',', begin), text.size());
    names.push_back(text.substr(begin, end - begin));
    begin = end + 1;
  }
  return names;
}

}  // namespace

RegisterView::RegisterView(int descriptor, const std::string& names, const std::string& drawn,
                           const program::Program& program, std::uint32_t width, std::uint32_t height)
    : descriptor_(descriptor), width_(width), height_(height) {
  for (const std::string& name : names.empty() ? std::vector<std::string>() : split_names(names)) {
    if (name == "all") {
      for (const program::Register& reg : program.registers)
        if (is_named(reg) && reg.width == width && reg.height == height) names_.push_back(reg.name);
    } else {
      add("--record-registers", name, program);
    }
  }
  if (!drawn.empty()) add("--cells apron:" + drawn, drawn, program);
  if (names_.size() > common::SharedPlanes::kMaxPlanes)
    throw common::UserError(
        fmt::format("--record-registers: the program has {} registers; at most {} can be recorded",
                    names_.size(), common::SharedPlanes::kMaxPlanes));
  for (const std::string& name : names_)
    if (name.size() > common::SharedPlanes::kMaxNameLength)
      throw common::UserError(fmt::format("--record-registers: the name '{}…' is longer than {} characters",
                                          name.substr(0, 20), common::SharedPlanes::kMaxNameLength));
  values_.resize(std::size_t{width} * height);
  if (!common::SharedPlanes::describe(descriptor_, {names_, height, width}))
    throw common::UserError("--show-registers: the descriptor cannot be written");
}

void RegisterView::add(const std::string& option, const std::string& name, const program::Program& program) {
  const auto index = program::find_register(program, name);
  if (!index)
    throw common::UserError(option + ": the program has no register " +
                            program::unknown_register(program, name));
  const program::Register& reg = program.registers[*index];
  if (reg.width != width_ || reg.height != height_)
    throw common::UserError(
        fmt::format("{}: register '{}' is {}x{}; one of the surface's size, {}x{}, can be shown", option,
                    name, reg.width, reg.height, width_, height_));
  if (std::ranges::find(names_, reg.name) == names_.end()) names_.push_back(reg.name);
}

void RegisterView::write(const vm::Vm& vm) {
  for (std::size_t i = 0; i < names_.size(); ++i) {
    const auto index = program::find_register(vm.program(), names_[i]);
    const bool fits = index && vm.program().registers[*index].width == width_ &&
                      vm.program().registers[*index].height == height_;
    if (fits) {
      const vm::Plane plane = vm.plane(*index);
      auto to = values_.begin();
      for (std::uint32_t y = 0; y < height_; ++y, to += width_)
        vm::with_cell_type(plane.type, [&]<class T>(T) {
          const T* const row = plane.cells<T>(y);
          std::transform(row, row + width_, to, [](T value) { return static_cast<float>(value); });
        });
    } else {
      std::ranges::fill(values_, std::numeric_limits<float>::quiet_NaN());
    }
    common::SharedPlanes::write(descriptor_, i * values_.size(), values_);
  }
}

}  // namespace apron::run
