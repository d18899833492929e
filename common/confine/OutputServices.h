// Outputs of a confined process as services of its broker.
#pragma once

#include <vector>

#include "common/confine/Broker.h"
#include "common/confine/Confinement.h"
#include "common/files/PreparedOutputs.h"

namespace common {

// Services for each output, which must outlive them: to create, to name and to remove it.
std::vector<Broker::Service> output_services(std::vector<PreparedOutput>&);
// Has the broker create the outputs, whose services are its first ones. Throws UserError.
void use_outputs_of(Broker&, const std::vector<PreparedOutput>&);
// Lets the process write them.
void add_outputs(Confinement&, const std::vector<PreparedOutput>&);

// Removes the new parts that got no name. Use it where the rights to do so are.
void remove_unnamed(const std::vector<PreparedOutput>&) noexcept;

}  // namespace common
