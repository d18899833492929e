#include "apron/library/EmbeddedHost.h"

#include <algorithm>

namespace apron::library {

std::optional<float> EmbeddedHost::parameter(std::string_view name) {
  const auto found = std::ranges::find(parameters_, name, &ParameterValues::value_type::first);
  return found == parameters_.end() ? std::nullopt : std::optional(found->second);
}

vm::HostStatus EmbeddedHost::refuse(std::string message) {
  message_ = std::move(message);
  return vm::HostStatus::kRefused;
}

vm::HostStatus EmbeddedHost::refuse_file(std::string_view file) {
  return refuse("a program reads and writes files only in apron run, not here" +
                (file.empty() ? std::string() : " ('" + std::string(file) + "')"));
}

}  // namespace apron::library
