"""OctoMaps of what LIDARs see: built, sent, kept as files, merged, and seen from above.

`mapping_node.Mapping` builds one, `merging_node.MapMerging` joins those of several UAVs.
"""
