// The options about clients: tokens, proxies, web origins, TLS. For this module only.
#pragma once

#include <vector>

#include "config/options/option_table.h"

namespace terrace::config {

// [{"name": "field-team", "sha256": "9f86d0...", "datasets": ["maui"]}]. No flag, because command lines are not secret.
Codec<Config> TokensCodec();

const std::vector<Option<TokenConfig>>& TokenOptionTable();

// {"certificate": "server.pem", "key": "server.key"}. As a flag: the two paths, separated by a comma.
Codec<Config> TlsCodec();

// ["https://maps.example"], ["*"] or []. As a flag: with commas between them.
Codec<Config> OriginsCodec();

// ["10.0.0.0/8", "::1"]. As a flag: with commas between them.
Codec<Config> ProxiesCodec();

}  // namespace terrace::config
