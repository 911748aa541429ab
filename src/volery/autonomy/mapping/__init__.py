"""OctoMaps from LIDARs: built, published, saved to files, merged, and projected to grids.

`mapping_node.Mapping` builds one, `merging_node.MapMerging` merges those of several UAVs.
"""
