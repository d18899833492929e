// A table of faults of single cells, measured or made up, as CSV (docs/actuators.md):
//
//   row,column,channel,fault,value
//   0,12,height,stuck,3.5
//
// Rows and columns count from 0, row 0 north. An empty channel means every channel of its cell; an empty
// value means that the fault has none. Lines that are empty or begin with # are skipped. Actuators and
// sensors read the same table, each the entries of its own channels.
#pragma once

#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "smartsurf/scene/SceneSpec.h"

namespace smartsurf::surface {

struct FaultEntry {
  int row = 0, column = 0;
  std::string channel;  // "": every one
  std::string fault;
  std::optional<double> value;  // finite
  int line = 0;                 // of the file, from 1
};

class FaultMap {
 public:
  FaultMap() = default;  // no entries
  // Throws scene::InputError "FILE:LINE: …" for anything that is not such a table of a surface of that size.
  FaultMap(const scene::FaultMapFile&, int rows, int columns);

  std::span<const FaultEntry> entries() const noexcept { return entries_; }

  // Throws scene::InputError unless every entry names one of these channels or none.
  void require_channels(const std::vector<std::string>& known) const;
  // Throws scene::InputError, "FILE:LINE: " and the clause.
  [[noreturn]] void refuse(const FaultEntry&, const std::string& clause) const;

 private:
  std::string name_;
  std::vector<FaultEntry> entries_;
};

}  // namespace smartsurf::surface
