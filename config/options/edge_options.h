// The options about clients: tokens, proxies, web pages, TLS. Used inside this room only.
#pragma once

#include <vector>

#include "config/options/option_table.h"

namespace terrace::config {

// [{"name": "field-team", "sha256": "9f86d0...", "datasets": ["maui"]}]. No flag: command lines are no place for
// secrets.
Codec<Config> TokensCodec();

const std::vector<Option<TokenConfig>>& TokenOptionTable();

// {"certificate": "server.pem", "key": "server.key"}. As a flag the two paths with a comma between them.
Codec<Config> TlsCodec();

// ["https://maps.example"], ["*"] or []. As a flag: with commas between them.
Codec<Config> OriginsCodec();

// ["10.0.0.0/8", "::1"]. As a flag: with commas between them.
Codec<Config> ProxiesCodec();

}  // namespace terrace::config
