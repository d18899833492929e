#include "smartsurf/run/ShownRegisters.h"

#include <fmt/format.h>

#include <algorithm>
#include <limits>

namespace smartsurf::run {

std::string ShownRegisters::argument() const {
  return fmt::format("{}:{}{}{}", planes_.descriptor(), names_, drawn_.empty() ? "" : ":", drawn_);
}

std::vector<std::string> ShownRegisters::expected_names() const {
  std::vector<std::string> names;
  for (std::size_t begin = 0; begin <= names_.size();) {
    const std::size_t end = std::min(names_.find(',', begin), names_.size());
    std::string name = names_.substr(begin, end - begin);
    if (!name.empty() && name != "all") names.push_back(std::move(name));
    begin = end + 1;
  }
  if (!drawn_.empty() && std::ranges::find(names, drawn_) == names.end()) names.push_back(drawn_);
  return names;
}

void ShownRegisters::restart() {
  channels_.clear();
  shown_names_.clear();
}

void ShownRegisters::read(const scene::SurfaceSpec& surface) {
  const std::size_t cells = surface.cell_count();
  if (channels_.empty()) {
    const auto planes =
        planes_.names(static_cast<std::uint32_t>(surface.rows), static_cast<std::uint32_t>(surface.columns));
    if (!planes) return;
    shown_names_ = planes->names;
    values_.resize(cells * shown_names_.size());
    for (std::size_t i = 0; i < shown_names_.size(); ++i)
      channels_.push_back({shown_names_[i], surface.rows, surface.columns, 1,
                           std::span<const float>(values_).subspan(i * cells, cells)});
  }
  if (!planes_.read(values_)) std::ranges::fill(values_, std::numeric_limits<float>::quiet_NaN());
}

}  // namespace smartsurf::run
