#include "common/confine/OutputServices.h"

#include <system_error>

namespace common {

std::vector<Broker::Service> output_services(const std::vector<PreparedOutput>& outputs) {
  std::vector<Broker::Service> services;
  for (const PreparedOutput& output : outputs) {
    services.emplace_back([&output] { return name_part(output).value(); });
    services.emplace_back([&output] {
      remove_part(output);
      return 0;
    });
  }
  return services;
}

void use_outputs_of(Broker& broker, const std::vector<PreparedOutput>& outputs) {
  use_prepared_outputs(outputs, {[&broker](std::size_t output) -> std::error_code {
                                   return {broker.ask(2 * output), std::generic_category()};
                                 },
                                 [&broker](std::size_t output) { broker.ask(2 * output + 1); }});
}

void add_outputs(Confinement& confinement, const std::vector<PreparedOutput>& outputs) {
  for (const PreparedOutput& output : outputs) confinement.write.push_back(output.part);
}

void remove_unnamed(const std::vector<PreparedOutput>& outputs) noexcept {
  for (const PreparedOutput& output : outputs)
    if (output.created) remove_part(output);
}

}  // namespace common
