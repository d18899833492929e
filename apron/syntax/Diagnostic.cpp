#include "apron/syntax/Diagnostic.h"

#include <fmt/format.h>

#include <algorithm>
#include <tuple>
#include <utility>

namespace apron::syntax {
namespace {

// Longest part of a source line shown, in bytes.
constexpr std::size_t kMaxShown = 400;
// Chains longer than this are shown by their ends.
constexpr std::size_t kMaxChain = 12;

auto place(const Location& at) { return std::tie(at.file, at.line, at.column); }

bool continues_character(char byte) { return (static_cast<unsigned char>(byte) & 0xC0U) == 0x80U; }

std::string printable(std::string_view line) {
  std::string text(line.substr(0, kMaxShown));
  for (char& byte : text) {
    const auto code = static_cast<unsigned char>(byte);
    if ((code < 0x20 && byte != '\t') || code == 0x7F) byte = '?';
  }
  return text;
}

// Spaces up to the column, with the line's own tabs so that the caret stands below its character.
std::string indent(std::string_view line, std::uint32_t column) {
  std::string blanks;
  std::uint32_t at = 1;
  for (const char byte : line) {
    if (at >= column) break;
    if (continues_character(byte)) continue;
    blanks += byte == '\t' ? '\t' : ' ';
    ++at;
  }
  while (at++ < column) blanks += ' ';
  return blanks;
}

std::vector<std::string> chain_of(const Location& start, const Sources& sources) {
  std::vector<std::string> chain;
  Location at = start;
  for (;;) {
    if (at.expansion != 0) {
      const Expansion& expansion = sources.expansion(at.expansion);
      chain.push_back(
          fmt::format("in expansion of macro '{}' at {}", expansion.macro, sources.name(expansion.call)));
      at = expansion.call;
    } else if (at.file < sources.file_count() && sources.file(at.file).included_from.line > 0) {
      at = sources.file(at.file).included_from;
      chain.push_back(fmt::format("included from {}", sources.name(at)));
    } else {
      break;
    }
  }
  return chain;
}

}  // namespace

void Diagnostics::error(Location at, std::string text, std::vector<Note> notes) {
  if (full_) return;
  full_ = ++reports_ >= kMaxReports;
  for (const Diagnostic& known : list_) {
    if (place(known.at) == place(at) && known.text == text) return;
  }
  list_.push_back({at, std::move(text), std::move(notes)});
  full_ = list_.size() >= kMaxErrors;
}

std::vector<Diagnostic> Diagnostics::take() {
  std::stable_sort(list_.begin(), list_.end(),
                   [](const Diagnostic& a, const Diagnostic& b) { return place(a.at) < place(b.at); });
  full_ = false;
  return std::exchange(list_, {});
}

std::string format(const Diagnostic& diagnostic, const Sources& sources) {
  const Location& at = diagnostic.at;
  if (at.line == 0) {
    const std::string file = at.file < sources.file_count() ? sources.file(at.file).name + ": " : "";
    return fmt::format("{}error: {}\n", file, diagnostic.text);
  }
  std::string text = fmt::format("{}: error: {}\n", sources.name(at), diagnostic.text);
  const std::string line = printable(sources.line(at.file, at.line));
  text += "    " + line + '\n';
  if (at.column <= line.size() + 1) text += "    " + indent(line, at.column) + "^\n";
  for (const Note& note : diagnostic.notes) {
    text += fmt::format("  note: {} at {}\n", note.text, sources.name(note.at));
  }
  const std::vector<std::string> chain = chain_of(at, sources);
  for (std::size_t i = 0; i < chain.size(); ++i) {
    if (chain.size() > kMaxChain && i == kMaxChain / 2) {
      text += fmt::format("  note: … {} more …\n", chain.size() - kMaxChain);
      i = chain.size() - kMaxChain / 2;
    }
    text += "  note: " + chain[i] + '\n';
  }
  return text;
}

std::string format(const std::vector<Diagnostic>& diagnostics, const Sources& sources) {
  std::string text;
  for (const Diagnostic& diagnostic : diagnostics) text += format(diagnostic, sources);
  if (diagnostics.size() >= kMaxErrors) text += fmt::format("error: stopped after {} errors\n", kMaxErrors);
  return text;
}

}  // namespace apron::syntax
