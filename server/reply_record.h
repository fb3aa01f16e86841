// What the access log and the metrics say of a reply.
#pragma once

#include "server/http/application.h"
#include "server/telemetry/access_log.h"

namespace terrace::server {

// All but the client and the token, which admission decides. Valid as long as `reply`.
ReplyRecord RecordOf(const SentReply& reply);

}  // namespace terrace::server
