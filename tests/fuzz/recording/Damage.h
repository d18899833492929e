// A recording, and damaged copies of it: what the fuzz target makes of its input.
#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <span>
#include <string>
#include <vector>

namespace fuzz {

// One change of a recording. An input is a byte for the recording, one for the reader, and changes of
// kChangeBytes bytes, little-endian: kind, which, at, value.
struct Change {
  enum Kind : std::uint8_t {
    // Through the library, so that the file stays well-formed. `which`: of the attributes or datasets that
    // can be changed so; all are taken modulo what there is.
    kNumber,  // an attribute's numbers: `value` as the bits of a double, or, with `at` odd, as an integer
    kText,    // an attribute's or dataset's text: kTexts[at], or the bytes of `value`
    kEntry,   // the entry `at` of a dataset of numbers: the bits of `value`
    kExtent,  // the extent of a growing dataset along axis `at`
    kShape,   // a dataset, or an attribute, of other numbers: `value` has type, rank and the extents'
              // logarithms
    kRemove,  // an object or attribute
    // In the file's bytes. `at`: from the beginning of the structure.
    kReference,  // of a text in a heap: length, address and number
    kStructure,  // an object's header, a heap, a table of names or a tree
    kBytes,      // `which` and `at`: their position in parts of the file; 1 to 8 bytes
    kCut,        // likewise
    kKinds
  };
  Kind kind;
  std::uint8_t which;
  std::uint16_t at;
  std::uint64_t value;
};
inline constexpr std::size_t kChangeBytes = 12, kMaxChanges = 16;

std::vector<Change> read_changes(std::span<const std::uint8_t> bytes);
// Runs the experiment for a few ticks and records it. Throws if it cannot.
void record_experiment(const std::string& script, const std::filesystem::path& recording);
// Replaces `to`. Only changes through the library need time.
void write_damaged(const std::filesystem::path& recording, std::span<const Change> changes,
                   const std::filesystem::path& to);

}  // namespace fuzz
