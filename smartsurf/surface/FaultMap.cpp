#include "smartsurf/surface/FaultMap.h"

#include <algorithm>
#include <array>
#include <map>
#include <utility>

#include "common/text/Suggestion.h"
#include "smartsurf/surface/CsvTable.h"

namespace smartsurf::surface {
namespace {

// The known name that is meant, or all of them.
std::string known_names(const std::string& name, const std::vector<std::string>& known) {
  const std::string nearest = common::nearest_name(name, known);
  if (!nearest.empty()) return " (did you mean '" + nearest + "'?)";
  std::string all;
  for (const std::string& other : known) all += (all.empty() ? "; known: " : ", ") + other;
  return all;
}

}  // namespace

FaultMap::FaultMap(const scene::FaultMapFile& file, int rows, int columns) : name_(file.name) {
  std::map<std::array<std::string, 4>, std::pair<int, std::string>> seen;
  for (const CsvRow& row : read_csv(file.name, file.text, "row,column,channel,fault,value", 1)) {
    if (row.text(3).empty()) row.refuse("fault: must not be empty");
    std::optional<double> value;
    if (!row.text(4).empty()) value = row.number(4, "value");
    // "stuck" and "dead" exclude each other, so they share one key.
    const std::string kind = row.text(3) == "dead" ? "stuck" : row.text(3);
    const auto [first, is_new] = seen.try_emplace({row.text(0), row.text(1), row.text(2), kind},
                                                  std::pair(row.line_number(), row.text(3)));
    if (!is_new)
      row.refuse("fault " + quote(row.text(3)) + ": the cell is " + first->second.second +
                 " already, by line " + std::to_string(first->second.first));
    entries_.push_back({row.index(0, "row", rows), row.index(1, "column", columns), row.text(2), row.text(3),
                        value, row.line_number()});
  }
}

FaultMap::FaultMap(const scene::FaultSpec& faults, int rows, int columns) {
  if (faults.fault_map) *this = FaultMap(*faults.fault_map, rows, columns);
  for (const scene::CellFault& c : faults.cells)
    entries_.push_back({c.row, c.column, c.channel, c.fault, c.value, 0});
}

void FaultMap::refuse(const FaultEntry& entry, const std::string& clause) const {
  if (entry.line == 0)
    throw scene::InputError("faults." + entry.channel + "." + entry.fault + " of cell (" +
                            std::to_string(entry.row) + ", " + std::to_string(entry.column) + "): " + clause);
  throw scene::InputError(name_ + ":" + std::to_string(entry.line) + ": " + clause);
}

void FaultMap::refuse_fault(const FaultEntry& entry, const std::string& owner,
                            const std::vector<std::string>& known) const {
  refuse(entry,
         "fault " + quote(entry.fault) + ": not a fault of " + owner + known_names(entry.fault, known));
}

void FaultMap::require_channels(const std::vector<std::string>& known) const {
  for (const FaultEntry& entry : entries_) {
    if (entry.channel.empty() || std::ranges::find(known, entry.channel) != known.end()) continue;
    refuse(entry,
           "channel " + quote(entry.channel) + ": no such channel" + known_names(entry.channel, known));
  }
}

}  // namespace smartsurf::surface
