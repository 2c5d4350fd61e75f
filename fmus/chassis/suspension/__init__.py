"""Elements of a suspension beside linear spring-dampers; one file each. Imported only where a vehicle has any."""
