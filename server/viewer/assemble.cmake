# cmake -DSOURCE_DIR= -DOUTPUT_DIR= -DNPM= -DPAGE= -DSTAMP= -P assemble.cmake: builds the viewer's folder from scratch.
# The stamp is set only when CesiumJS is in it: without, the next build tries again.
file(REMOVE_RECURSE "${OUTPUT_DIR}")
file(COPY ${PAGE} DESTINATION "${OUTPUT_DIR}")

set(cesium "${SOURCE_DIR}/node_modules/cesium/Build/Cesium")
if(NOT EXISTS "${cesium}/index.js" AND NPM)
  message(STATUS "Fetching CesiumJS")
  execute_process(COMMAND "${NPM}" ci --ignore-scripts --no-audit --no-fund WORKING_DIRECTORY "${SOURCE_DIR}" RESULT_VARIABLE status)
endif()
if(EXISTS "${cesium}/index.js")
  # What a globe with terrain can ask for; the other bundles and the widgets' toolbars stay behind.
  file(COPY "${cesium}/index.js" "${cesium}/Assets" "${cesium}/ThirdParty" "${cesium}/Workers"
       DESTINATION "${OUTPUT_DIR}/cesium" PATTERN "*.map" EXCLUDE)
  file(COPY "${cesium}/Widgets/CesiumWidget/CesiumWidget.css" DESTINATION "${OUTPUT_DIR}/cesium/Widgets/CesiumWidget")
  file(COPY "${SOURCE_DIR}/node_modules/cesium/LICENSE.md" DESTINATION "${OUTPUT_DIR}/cesium")
else()
  message(WARNING "The viewer is without CesiumJS: npm is missing or could not fetch it.")
endif()

# gzip -n leaves out name and time: the same files give the same bytes. -k keeps the plain file for clients without gzip.
file(GLOB_RECURSE compressible "${OUTPUT_DIR}/*.html" "${OUTPUT_DIR}/*.css" "${OUTPUT_DIR}/*.js" "${OUTPUT_DIR}/*.json"
     "${OUTPUT_DIR}/*.wasm" "${OUTPUT_DIR}/*.svg")
execute_process(COMMAND gzip -n -9 -k -f ${compressible} COMMAND_ERROR_IS_FATAL ANY)
if(EXISTS "${OUTPUT_DIR}/cesium")
  file(TOUCH "${STAMP}")
endif()
