#include "apron/syntax/Diagnostic.h"

#include <fmt/format.h>

#include <algorithm>
#include <set>
#include <tuple>
#include <utility>

namespace apron::syntax {
namespace {

// Longest part of a source line shown, in bytes.
constexpr std::size_t kMaxShownBytes = 400;
// Longest message, in bytes: one may quote a word of the program as long as its file.
constexpr std::size_t kMaxMessageBytes = 1000;
// Longer chains are shortened to both ends.
constexpr std::size_t kMaxChainNotes = 12;

auto sort_key(const Location& location) { return std::tie(location.file, location.line, location.column); }

bool is_continuation_byte(char byte) { return (static_cast<unsigned char>(byte) & 0xC0U) == 0x80U; }

std::string shortened(std::string message) {
  if (message.size() <= kMaxMessageBytes) return message;
  std::size_t end = kMaxMessageBytes;
  while (end > 0 && is_continuation_byte(message[end])) --end;
  message.resize(end);
  return message + "…";
}

std::string printable(std::string_view line) {
  std::string text(line.substr(0, kMaxShownBytes));
  for (char& byte : text) {
    const auto code = static_cast<unsigned char>(byte);
    if ((code < 0x20 && byte != '\t') || code == 0x7F) byte = '?';
  }
  return text;
}

// Padding up to the column that repeats the line's tabs, so that the caret aligns with its character.
std::string caret_indent(std::string_view line, std::uint32_t column) {
  std::string padding;
  std::uint32_t current = 1;
  for (const char byte : line) {
    if (current >= column) break;
    if (is_continuation_byte(byte)) continue;
    padding += byte == '\t' ? '\t' : ' ';
    ++current;
  }
  while (current++ < column) padding += ' ';
  return padding;
}

std::vector<std::string> expansion_chain(const Location& start, const SourceManager& sources) {
  std::vector<std::string> chain;
  Location current = start;
  for (;;) {
    if (current.expansion != 0) {
      const ExpansionInfo& expansion = sources.expansion(current.expansion);
      chain.push_back(fmt::format("in {} '{}' at {}",
                                  expansion.is_function ? "the call of function" : "expansion of macro",
                                  expansion.macro, sources.format_location(expansion.call)));
      current = expansion.call;
    } else if (current.file < sources.file_count() && sources.file(current.file).included_from.line > 0) {
      current = sources.file(current.file).included_from;
      chain.push_back(fmt::format("included from {}", sources.format_location(current)));
    } else {
      break;
    }
  }
  return chain;
}

void sort_by_location(std::vector<Diagnostic>& diagnostics) {
  std::ranges::stable_sort(diagnostics, [](const Diagnostic& a, const Diagnostic& b) {
    return sort_key(a.location) < sort_key(b.location);
  });
}

}  // namespace

void Diagnostics::error(Location location, std::string message, std::vector<Note> notes) {
  if (full_) return;
  message = shortened(std::move(message));
  full_ = !keeps_repeats_ && ++report_count_ >= kMaxReportedErrors;
  for (const Diagnostic& existing : diagnostics_) {
    if (sort_key(existing.location) == sort_key(location) && existing.message == message &&
        (!keeps_repeats_ || existing.location.expansion == location.expansion))
      return;
  }
  diagnostics_.push_back({location, std::move(message), std::move(notes), false});
  full_ = diagnostics_.size() >= max_errors_;
}

void Diagnostics::final_error(Location location, std::string message) {
  error(location, std::move(message));
  full_ = true;
}

void Diagnostics::conditional_error(Location location, std::string message) {
  const std::size_t count = diagnostics_.size();
  error(location, std::move(message));
  if (diagnostics_.size() > count) diagnostics_.back().is_conditional = true;
}

void Diagnostics::warning(Location location, std::string message) {
  if (warnings_.size() < kMaxErrors) warnings_.push_back({location, shortened(std::move(message)), {}, true});
}

std::vector<Diagnostic> Diagnostics::take() {
  sort_by_location(diagnostics_);
  full_ = false;
  return std::exchange(diagnostics_, {});
}

std::vector<Diagnostic> Diagnostics::take_warnings() {
  sort_by_location(warnings_);
  return std::exchange(warnings_, {});
}

std::string format_diagnostics(const Diagnostic& diagnostic, const SourceManager& sources) {
  const Location& location = diagnostic.location;
  const char* severity = diagnostic.is_warning ? "warning" : "error";
  if (location.line == 0) {
    const std::string file =
        location.file < sources.file_count() ? sources.file(location.file).name + ": " : "";
    return fmt::format("{}{}: {}\n", file, severity, diagnostic.message);
  }
  std::string text =
      fmt::format("{}: {}: {}\n", sources.format_location(location), severity, diagnostic.message);
  const std::string line = printable(sources.line_text(location.file, location.line));
  text += "    " + line + '\n';
  if (location.column <= line.size() + 1) text += "    " + caret_indent(line, location.column) + "^\n";
  for (const Note& note : diagnostic.notes) {
    text += fmt::format("  note: {} at {}\n", note.message, sources.format_location(note.location));
  }
  const std::vector<std::string> chain = expansion_chain(location, sources);
  for (std::size_t i = 0; i < chain.size(); ++i) {
    if (chain.size() > kMaxChainNotes && i == kMaxChainNotes / 2) {
      text += fmt::format("  note: … {} more …\n", chain.size() - kMaxChainNotes);
      i = chain.size() - kMaxChainNotes / 2;
    }
    text += "  note: " + chain[i] + '\n';
  }
  return text;
}

std::string format_diagnostics(const std::vector<Diagnostic>& diagnostics, const SourceManager& sources) {
  std::string text;
  std::set<std::tuple<std::string, std::string>> shown;  // of a file that is included twice, once
  for (const Diagnostic& diagnostic : diagnostics)
    if (shown.emplace(sources.format_location(diagnostic.location), diagnostic.message).second)
      text += format_diagnostics(diagnostic, sources);
  if (diagnostics.size() >= kMaxErrors && !diagnostics.back().is_warning)
    text += fmt::format("error: stopped after {} errors\n", kMaxErrors);
  return text;
}

}  // namespace apron::syntax
